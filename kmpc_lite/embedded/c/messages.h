/* Messages between a host and the robot: framing, checks, numbers.
 *
 * A message is one byte of version, one of kind, its payload, and CRC-16/XMODEM of all that, high
 * byte first; COBS removes its zeros, and a zero ends it. Numbers are little-endian; a float is an
 * IEEE 754 single. The host reckons the robot's time from what it is told, so that what waited on
 * the line is old when it comes. Whatever else comes is counted and passed over. The Python twin is
 * `firmware_bridge.drivers.onboard`.
 */
#ifndef KMPC_MESSAGES_H
#define KMPC_MESSAGES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    KMPC_PROTOCOL = 1,    /* version: other ones are not understood */
    KMPC_PAYLOAD = 1024,  /* bytes at most */
    KMPC_FRAME = KMPC_PAYLOAD + 12 /* a whole message with what COBS adds, and its end */
};

enum kmpc_kind {
    /* from the host */
    KMPC_SAY_HEARTBEAT = 1, /* u32 number, which telemetry repeats */
    KMPC_SAY_POSE,          /* 3 floats [m, m, rad], u32 the robot's time of it [ms] */
    KMPC_SAY_GOAL,          /* 3 floats [m, m, rad]; nothing: stand */
    KMPC_SAY_OBSTACLES,     /* 5 floats each: x, y, radius [m], vx, vy [m/s]; nothing: none */
    KMPC_SAY_PATH,          /* 3 floats each [m, m, rad]; nothing: straight to the goal */
    KMPC_SAY_VELOCITY = 7,  /* (6 was a model) 2 floats [m/s, rad/s], u32 the robot's time [ms] */
    KMPC_SAY_ESTOP,         /* nothing: stand at once, until released */
    KMPC_SAY_RELEASE,       /* nothing: as if nothing had been said */
    KMPC_SAY_ASK,           /* nothing: who is there? */
    /* from the robot */
    KMPC_TELL_ABOUT = 128, /* see host.c */
    KMPC_TELL_STATE,       /* see host.c */
    KMPC_TELL_WHEELS       /* 2 floats: speeds of the left and the right rim [m/s] */
};

struct kmpc_decoder {
    unsigned char frame[KMPC_FRAME];
    int length;   /* bytes of the frame under way; negative while one is passed over */
    int size;     /* of the payload of a whole message */
    uint32_t good, bad;
};

/* Take a byte: the kind of a whole message, whose payload is `kmpc_payload`, else 0. */
int kmpc_decode(struct kmpc_decoder *decoder, unsigned char byte);
const unsigned char *kmpc_payload(const struct kmpc_decoder *decoder);

/* Write a message, a zero at its end, into KMPC_FRAME bytes; how many. */
int kmpc_encode(int kind, const unsigned char *payload, int size, unsigned char *frame);

unsigned kmpc_crc16(const unsigned char *bytes, int count);

/* Numbers from and to a payload; those that write return what is behind. */
uint32_t kmpc_get(const unsigned char *from, int bytes);
float kmpc_get_float(const unsigned char *from);
unsigned char *kmpc_put(unsigned char *to, uint32_t value, int bytes);
unsigned char *kmpc_put_float(unsigned char *to, float value);

#ifdef __cplusplus
}
#endif
#endif
