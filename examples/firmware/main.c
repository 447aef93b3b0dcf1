/* A robot that needs no Linux: messages of a host in, speeds of two wheels out, 50 times a second.
 *
 * It plans every KMPC_DT. Without fresh poses, obstacles, path and heartbeats it comes to rest by
 * itself; if this loop hangs, the watchdog starts the board anew, with its wheels at rest.
 */
#include "board.h"
#include "host.h"

#ifndef TRACK
#define TRACK R(0.27) /* between the wheels' middles [m] */
#endif

enum { TICK = 20 /* ms */, REPORT_EVERY = 5 /* ticks */, AT_ONCE = 256 /* bytes */, PASSES = 2 };

static void send_wheels(real speed, real turn_rate)
{
    unsigned char payload[8], frame[KMPC_FRAME], *at = payload;
    const real turn = turn_rate * TRACK / 2;
    at = kmpc_put_float(at, (float)(speed - turn));
    kmpc_put_float(at, (float)(speed + turn));
    board_write(BOARD_MOTORS, frame, kmpc_encode(KMPC_TELL_WHEELS, payload, sizeof(payload), frame));
}

static void listen(struct kmpc_host *host)
{
    for (int i = 0, byte; i < AT_ONCE && (byte = board_read()) >= 0; i++)
        kmpc_host_take(host, board_milliseconds(), (unsigned char)byte);
}

int main(void)
{
    static struct kmpc_host host;
    static unsigned char frame[KMPC_FRAME];
    real command[2];
    board_start();
    kmpc_host_reset(&host);
    host.passes = PASSES;
    uint32_t due = board_milliseconds();
    for (uint32_t tick = 0;; tick++) {
        kmpc_host_tick(&host, board_milliseconds(), command);
        send_wheels(command[0], command[1]);
        board_feed_watchdog();
        if (tick % REPORT_EVERY == 0 || host.asked)
            board_write(BOARD_HOST, frame, kmpc_host_report(&host, board_milliseconds(), frame));
        due += TICK;
        if ((int32_t)(board_milliseconds() - due) > TICK) /* late: do not catch up */
            due = board_milliseconds();
        do {
            listen(&host);
            board_sleep();
        } while ((int32_t)(board_milliseconds() - due) < 0);
    }
}
