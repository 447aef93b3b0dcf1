/* Runs the sketch with two simulated motors: speed, wheel with a dead encoder (-1: none), milliseconds.
 *
 * A wheel turns as fast as its share of full power says, from STICKS on. Prints when the encoder fault is told [ms,
 * -1: never], the largest share of full power on the second motor, both shares at the end, and the faults after R.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OUTPUT, INPUT_PULLUP, LOW = 0, CHANGE = 1 };
#define constrain(x, low, high) ((x) < (low) ? (low) : (x) > (high) ? (high) : (x))
#ifndef KMPC_MOTORS
#define KMPC_MOTORS 2
#define KMPC_SERVO 0
#endif
static const float STICKS = 0.05f;
static unsigned long clock_ms = 5000;
static int level[64];
static char incoming[256];
static int waiting, given, answered;
static char answers[4096];

struct Port {
  void begin(long) {}
  int available() { return waiting - given; }
  int read() { return incoming[given++]; }
  void write(const uint8_t *data, size_t size) {
    memcpy(answers, data, size);
    answered = (int)size;
    answers[answered] = 0;
  }
} Serial;
static unsigned long millis() { return clock_ms; }
static void pinMode(int, int) {}
static int digitalRead(int) { return 1; }
static void analogWrite(int pin, int value) { level[pin] = value; }
static int digitalPinToInterrupt(int pin) { return pin; }
static void attachInterrupt(int, void (*)(), int) {}
static void noInterrupts() {}
static void interrupts() {}

#include "kmpc_wheels.ino"

static float share(int i) { return (float)(level[FORWARD[i]] - level[BACKWARD[i]]) / 255.0f; }

static void ask(const char *text) {
  int length = snprintf(incoming, sizeof incoming, "%s*%04X\n", text, (unsigned)kmpc_crc(text, (int)strlen(text)));
  waiting = length;
  given = 0;
}

int main(int, char **given_words) {
  long speed = atol(given_words[1]), dead = atol(given_words[2]), end = atol(given_words[3]);
  float turned[2] = {0.0f, 0.0f}, largest = 0.0f;
  long told = -1;
  char text[64];
  setup();
  for (long k = -100; k < end; k++, clock_ms++) {
    if (k >= 0 && k % 50 == 0) {
      snprintf(text, sizeof text, "V 1 %ld %ld 300", speed, -speed);
      ask(text);
    }
    loop();
    for (int i = 0; i < 2; i++) {
      float now = share(i);
      turned[i] += now > STICKS || now < -STICKS ? now * TOP_SPEED / 1000.0f : 0.0f;
      counts[i] = i == dead ? (int32_t)(k % 2) : (int32_t)turned[i]; /* a line that flickers */
    }
    float size = share(1) < 0.0f ? -share(1) : share(1);
    largest = size > largest ? size : largest;
    if (told < 0 && (wheels.faults & KMPC_ENCODER)) told = k;
  }
  float left = share(0), right = share(1);
  ask("R 2");
  loop();
  clock_ms += 20;
  loop();
  printf("%ld %.3f %.3f %.3f %d\n", told, (double)largest, (double)left, (double)right, wheels.faults);
  return 0;
}
