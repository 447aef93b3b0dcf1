/* Arm's MPS2 boards as QEMU has them (mps2-an386: Cortex-M4F, mps2-an500: Cortex-M7): 25 MHz. */
#include "board.h"

#include <string.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

enum {
    UART = 0x40004000, /* the next one 0x1000 above */
    DATA = 0x0,
    STATE = 0x4,
    CONTROL = 0x8,
    INTERRUPT = 0xc,
    DIVIDER = 0x10,
    TIMER = 0x40000000,
    WATCHDOG = 0x40008000,
    FED = 0xc
};
#define SYSTICK 0xe000e010u
#define COPROCESSORS 0xe000ed88u
#define ENABLED_INTERRUPTS 0xe000e100u

enum { RING = 2048, PATIENCE = 2, CLOCK = 25000000, BAUD = 115200 };

/* Places of the linker; sizes are addresses, too. */
extern unsigned char data_begins[], data_is_in[], data_size[], bss_begins[], bss_size[];
extern unsigned char bss_ends[], stack_begins[];
int main(void);

static volatile uint32_t milliseconds;
static volatile unsigned char ring[RING];
static volatile uint32_t received;
static uint32_t taken;

/* By the timer, not by counting: ticks are lost while interrupts wait. */
static void on_tick(void)
{
    static uint32_t last, part;
    const uint32_t now = board_ticks();
    part += now - last;
    last = now;
    milliseconds += part / (CLOCK / 1000);
    part %= CLOCK / 1000;
}

static void on_host(void)
{
    REGISTER(UART + INTERRUPT) = 2;
    while (REGISTER(UART + STATE) & 2) {
        const unsigned char byte = (unsigned char)REGISTER(UART + DATA);
        if (received - taken < RING)
            ring[received++ % RING] = byte;
    }
}

void board_start(void)
{
    for (int port = 0; port < 2; port++) {
        REGISTER(UART + 0x1000 * port + DIVIDER) = CLOCK / BAUD;
        REGISTER(UART + 0x1000 * port + CONTROL) = port == BOARD_HOST ? 1 + 2 + 8 : 1;
    }
    REGISTER(ENABLED_INTERRUPTS) = 1; /* the host's bytes */
    REGISTER(SYSTICK + 4) = CLOCK / 1000 - 1;
    REGISTER(SYSTICK + 8) = 0;
    REGISTER(SYSTICK) = 7;
    REGISTER(TIMER + 8) = 0xffffffff; /* from there down, again and again */
    REGISTER(TIMER + 4) = 0xffffffff;
    REGISTER(TIMER) = 1;
    REGISTER(WATCHDOG) = CLOCK / 4; /* twice that resets */
    REGISTER(WATCHDOG + 8) = 3;
}

uint32_t board_milliseconds(void)
{
    return milliseconds;
}

int board_read(void)
{
    return taken == received ? -1 : ring[taken++ % RING];
}

void board_write(int port, const unsigned char *bytes, int count)
{
    const uintptr_t uart = (uintptr_t)(UART + 0x1000 * port);
    const uint32_t begun = milliseconds;
    for (int i = 0; i < count; i++) {
        while (REGISTER(uart + STATE) & 1)
            if (milliseconds - begun > PATIENCE)
                return;
        REGISTER(uart + DATA) = bytes[i];
    }
}

void board_sleep(void)
{
    __asm__ volatile("wfi");
}

void board_feed_watchdog(void)
{
    REGISTER(WATCHDOG + FED) = 1;
}

uint32_t board_ticks(void)
{
    return ~REGISTER(TIMER + 4);
}

unsigned char *board_end_of_memory(void)
{
    return bss_ends;
}

void board_exit(int code)
{
    const uint32_t block[2] = {0x20026, (uint32_t)code};
    register uint32_t operation __asm__("r0") = 0x20; /* semihosting: exit with a code */
    register const uint32_t *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
    for (;;)
        ;
}

/* What newlib's printf writes goes to the host. */
int _write(int file, const char *bytes, int count)
{
    (void)file;
    for (int i = 0; i < count; i++) {
        while (REGISTER(UART + STATE) & 1)
            ;
        REGISTER(UART + DATA) = (unsigned char)bytes[i];
    }
    return count;
}

void on_reset(void);
void on_reset(void)
{
    memcpy(data_begins, data_is_in, (size_t)(uintptr_t)data_size);
    memset(bss_begins, 0, (size_t)(uintptr_t)bss_size);
    REGISTER(COPROCESSORS) |= 0xfu << 20; /* the unit for floating point */
    __asm__ volatile("dsb\n isb");
    board_exit(main());
}

static void on_fault(void)
{
    board_exit(99);
}

/* The watchdog's first time-out: the second one resets. */
static void on_warning(void)
{
    for (;;)
        ;
}

typedef void (*handler)(void);
__attribute__((section(".vectors"), used)) static const handler vectors[17] = {
    (handler)(uintptr_t)stack_begins,
    on_reset,
    on_warning,
    on_fault,
    on_fault,
    on_fault,
    on_fault,
    [15] = on_tick,
    [16] = on_host,
};
