/* What a robot's program needs of its board; write these for yours. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

enum { BOARD_HOST, BOARD_MOTORS }; /* its two serial ports */

void board_start(void);
uint32_t board_milliseconds(void); /* since the start; wraps */

/* A byte that came from the host, or -1. */
int board_read(void);

/* Send bytes; what a line does not take in time is dropped. */
void board_write(int port, const unsigned char *bytes, int count);

void board_sleep(void);         /* until something happens, a millisecond at most */
void board_feed_watchdog(void); /* or the board starts anew after half a second */

/* For measurements alone. */
uint32_t board_ticks(void); /* of 40 ns: 40 instructions in QEMU with -icount shift=0 */
unsigned char *board_end_of_memory(void); /* in use; the stack comes down to it from above */
void board_exit(int code);

#endif
