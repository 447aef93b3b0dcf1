/* The line protocol of docs/howto/boards.md: bytes in, answers out, and the watchdog.
 *
 * Plain C99 without the Arduino library, so that it compiles with gcc and is tested there. Whoever includes it gives
 * it bytes and the time, and finds in `struct kmpc_wheels` what the motors are to do.
 */
#ifndef KMPC_WHEELS_H
#define KMPC_WHEELS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#ifndef KMPC_MOTORS
#define KMPC_MOTORS 2 /* 1 of a car, 3 or 4 of an omni */
#endif
#ifndef KMPC_SERVO
#define KMPC_SERVO 0 /* 1: a servo steers */
#endif
#define KMPC_VERSION 2
#define KMPC_LONGEST_LINE (24 + 12 * (KMPC_MOTORS + KMPC_SERVO)) /* bytes of a request, without its line feed */
#define KMPC_LONGEST_REPLY (48 + 24 * KMPC_MOTORS) /* bytes of an answer, with line feed and zero */
#define KMPC_SHORTEST_PULSE 500       /* us of a servo */
#define KMPC_LONGEST_PULSE 2500       /* us */
#define KMPC_LONGEST_WATCHDOG 60000L  /* ms */
#define KMPC_DEAD_AFTER 250           /* ms for which the counter of a driven wheel may stand */
#define KMPC_DITHER 2                 /* counts by which a counter that stands may go to and fro */

enum { KMPC_DRIVEN = 1, KMPC_WATCHDOG = 2, KMPC_STOPPED = 4, KMPC_ENCODER = 8, KMPC_FAULT = 16 };

struct kmpc_wheels {
  /* what the motors are to do: read them */
  int32_t target[KMPC_MOTORS]; /* counts/s of each channel; 0 unless driven */
  int32_t servo;     /* pulse of the servo [us]; 0 until one is commanded */
  bool driven;       /* false: let the motors go */
  /* what the motors do: write them */
  int32_t count[KMPC_MOTORS]; /* encoder counts, wrapping */
  int32_t speed[KMPC_MOTORS]; /* counts/s */
  uint8_t faults;   /* KMPC_STOPPED, KMPC_ENCODER, KMPC_FAULT; any of them lets the motors go */
  bool dead;        /* of kmpc_watch: a wheel is driven and its counter stands; until the motors are let go */
  /* of the protocol, and of kmpc_watch */
  bool expired;
  uint32_t heard, watchdog; /* ms */
  char line[KMPC_LONGEST_LINE];
  uint8_t length;
  bool dropping;
  int32_t stood_at[KMPC_MOTORS];
  uint32_t stood_since[KMPC_MOTORS];
};

static inline uint16_t kmpc_crc(const char *text, int length) {
  uint16_t crc = 0; /* CRC-16/XMODEM */
  for (int i = 0; i < length; i++) {
    crc ^= (uint16_t)((uint16_t)(uint8_t)text[i] << 8);
    for (int bit = 0; bit < 8; bit++) {
      crc = (uint16_t)((crc & 0x8000u) ? (uint16_t)(crc << 1) ^ 0x1021u : (uint16_t)(crc << 1));
    }
  }
  return crc;
}

/* One whole number behind one blank, within int32; false where there is none. */
static inline bool kmpc_number(const char **at, const char *end, int32_t *value) {
  const char *p = *at;
  if (p == end || *p++ != ' ') return false;
  bool negative = p != end && *p == '-';
  if (negative) p++;
  int64_t sum = 0;
  int digits = 0;
  for (; p != end && *p >= '0' && *p <= '9'; p++, digits++) {
    if (digits == 10) return false;
    sum = 10 * sum + (*p - '0');
  }
  if (negative) sum = -sum;
  if (digits == 0 || sum < INT32_MIN || sum > INT32_MAX) return false;
  *value = (int32_t)sum;
  *at = p;
  return true;
}

/* Call it often: lets the motors go when no command has come for as long as the last one allowed. */
static inline void kmpc_check(struct kmpc_wheels *w, uint32_t now) {
  if (w->driven && now - w->heard > w->watchdog) {
    w->driven = false;
    w->expired = true;
  }
  if (w->faults || !w->driven) {
    w->driven = w->driven && !w->faults;
    for (int i = 0; i < KMPC_MOTORS; i++) w->target[i] = 0;
  }
}

/* Call it with each turn of the speed loop: sees whether the counter of a wheel stands although it is driven hard
 * enough to turn. Its encoder may be unplugged, and a loop that believes it drives the motor at full power. */
static inline void kmpc_watch(struct kmpc_wheels *w, int i, bool pushed, uint32_t now) {
  uint32_t moved = (uint32_t)w->count[i] - (uint32_t)w->stood_at[i] + KMPC_DITHER;
  if (!pushed || moved > 2 * KMPC_DITHER) {
    w->stood_at[i] = w->count[i];
    w->stood_since[i] = now;
  } else if (now - w->stood_since[i] >= KMPC_DEAD_AFTER) {
    w->dead = true;
  }
}

static inline int kmpc_finish(char *reply, int length) {
  return length + snprintf(reply + length, KMPC_LONGEST_REPLY - (size_t)length, "*%04X\n",
                           (unsigned)kmpc_crc(reply, length));
}

/* Obey one line; length of the answer in `reply`, 0 for a line that is none. */
static inline int kmpc_obey(struct kmpc_wheels *w, uint32_t now, char *reply) {
  int body = w->length - 5;
  if (body < 3 || w->line[body] != '*') return 0;
  uint16_t check = 0;
  for (int i = 1; i <= 4; i++) {
    char c = w->line[body + i];
    bool digit = c >= '0' && c <= '9', letter = c >= 'A' && c <= 'F';
    if (!digit && !letter) return 0;
    check = (uint16_t)(check << 4 | (digit ? c - '0' : c - 'A' + 10));
  }
  if (check != kmpc_crc(w->line, body)) return 0;
  const char *at = w->line + 1, *end = w->line + body;
  int32_t number[KMPC_MOTORS + KMPC_SERVO + 2];
  const int most = KMPC_MOTORS + KMPC_SERVO + 2;
  int count = 0;
  while (at != end) {
    if (count == most || !kmpc_number(&at, end, &number[count++])) return 0;
  }
  if (count == 0 || number[0] < 0 || number[0] > 255) return 0;
  switch (w->line[0]) {
    case 'H':
      if (count != 1) return 0;
      return kmpc_finish(reply, snprintf(reply, KMPC_LONGEST_REPLY, "H %d %d %d %d", (int)number[0],
                                         KMPC_VERSION, KMPC_MOTORS, KMPC_SERVO));
    case 'V':
      if (count != most || number[most - 1] <= 0 || number[most - 1] > KMPC_LONGEST_WATCHDOG) return 0;
      if (KMPC_SERVO && (number[most - 2] < KMPC_SHORTEST_PULSE || number[most - 2] > KMPC_LONGEST_PULSE)) return 0;
      for (int i = 0; i < KMPC_MOTORS; i++) w->target[i] = number[1 + i];
      if (KMPC_SERVO) w->servo = number[most - 2];
      w->watchdog = (uint32_t)number[most - 1];
      w->heard = now;
      w->driven = true;
      w->expired = false;
      break;
    case 'R':
      if (count != 1) return 0;
      w->driven = false;
      w->dead = false;
      break;
    case 'P':
      if (count != 1) return 0;
      break;
    default:
      return 0;
  }
  kmpc_check(w, now);
  int flags = w->faults | (w->driven ? KMPC_DRIVEN : 0) | (w->expired ? KMPC_WATCHDOG : 0);
  int at_end = snprintf(reply, KMPC_LONGEST_REPLY, "S %d %lu", (int)number[0], (unsigned long)now);
  for (int i = 0; i < 2 * KMPC_MOTORS; i++) {
    int32_t value = i < KMPC_MOTORS ? w->count[i] : w->speed[i - KMPC_MOTORS];
    at_end += snprintf(reply + at_end, KMPC_LONGEST_REPLY - (size_t)at_end, " %ld", (long)value);
  }
  at_end += snprintf(reply + at_end, KMPC_LONGEST_REPLY - (size_t)at_end, " %d", flags);
  return kmpc_finish(reply, at_end);
}

/* Take one byte at `now` [ms]; length of the answer in `reply` (KMPC_LONGEST_REPLY bytes), mostly 0. */
static inline int kmpc_feed(struct kmpc_wheels *w, char byte, uint32_t now, char *reply) {
  if (byte == '\n' || byte == '\r') {
    int length = w->length && !w->dropping ? kmpc_obey(w, now, reply) : 0;
    w->length = 0;
    w->dropping = false;
    return length;
  }
  if (w->length < KMPC_LONGEST_LINE && !w->dropping) {
    w->line[w->length++] = byte;
  } else {
    w->dropping = true;
  }
  return 0;
}

#endif
