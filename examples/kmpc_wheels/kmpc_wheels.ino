/* Motors with quadrature encoders, and a servo that steers a car, on an ESP32 or an Arduino with enough interrupts (Mega, Due, Teensy):
 * the board's end of `driver = "arduino"`. Set-up: docs/howto/boards.md, protocol: PROTOCOL.md
 *
 * Change the numbers of this block for your robot, nothing else.
 */
#ifndef KMPC_MOTORS
#define KMPC_MOTORS 2 /* 2: left and right; 1: a car; 3 or 4: an omni's, in the order of docs/howto/boards.md */
#define KMPC_SERVO 0  /* 1: a servo steers (a library with Servo.h; ESP32: ESP32Servo) */
#endif
#include "kmpc_wheels.h"
#if KMPC_SERVO
#include <Servo.h>
#endif

static const long BAUD = 115200;
/* Of up to four motors: inputs of the H-bridge, with PWM, and encoders. */
static const int FORWARD[4] = {25, 27, 16, 18}, BACKWARD[4] = {26, 14, 17, 19};
static const int ENCODER_A[4] = {32, 34, 4, 13}, ENCODER_B[4] = {33, 35, 5, 15};
static const int SERVO_PIN = 23;
static const int STOP_PIN = -1;              /* a switch to ground that stops the motors; -1 for none */
static const float TOP_SPEED = 6000.0f;      /* counts/s of a motor at full power */
static const float P_GAIN = 0.5f, I_GAIN = 4.0f; /* of the speed loop, in shares of full power */
static const float TURNS_AT = 0.15f;         /* share of full power at which a wheel surely turns on the ground */
static const unsigned long PERIOD = 10;      /* of the speed loop [ms] */

static struct kmpc_wheels wheels;
static volatile int32_t counts[KMPC_MOTORS];
static float integral[KMPC_MOTORS];
static int32_t last_count[KMPC_MOTORS];
#if KMPC_SERVO
static Servo servo;
#endif
static unsigned long last_loop;

/* Both edges of A, with the level of B: two counts a pulse; counts_per_turn = 2 * pulses per turn. */
static void edge(int i) {
  counts[i] += digitalRead(ENCODER_A[i]) == digitalRead(ENCODER_B[i]) ? -1 : 1;
}
static void edge_first() { edge(0); }
#if KMPC_MOTORS > 1
static void edge_second() { edge(1); }
#endif
#if KMPC_MOTORS > 2
static void edge_third() { edge(2); }
#endif
#if KMPC_MOTORS > 3
static void edge_fourth() { edge(3); }
#endif
static void (*const EDGES[KMPC_MOTORS])() = {
  edge_first,
#if KMPC_MOTORS > 1
  edge_second,
#endif
#if KMPC_MOTORS > 2
  edge_third,
#endif
#if KMPC_MOTORS > 3
  edge_fourth,
#endif
};

static void power(int i, float share) {
  int level = (int)(255.0f * constrain(share, -1.0f, 1.0f));
  analogWrite(FORWARD[i], level > 0 ? level : 0);
  analogWrite(BACKWARD[i], level < 0 ? -level : 0);
}

void setup() {
  for (int i = 0; i < KMPC_MOTORS; i++) {
    pinMode(FORWARD[i], OUTPUT);
    pinMode(BACKWARD[i], OUTPUT);
    power(i, 0.0f);
    pinMode(ENCODER_A[i], INPUT_PULLUP);
    pinMode(ENCODER_B[i], INPUT_PULLUP);
    attachInterrupt(digitalPinToInterrupt(ENCODER_A[i]), EDGES[i], CHANGE);
  }
#if KMPC_SERVO
  servo.attach(SERVO_PIN);
#endif
  if (STOP_PIN >= 0) pinMode(STOP_PIN, INPUT_PULLUP);
  Serial.begin(BAUD);
}

static void speed_loop(float seconds, unsigned long now) {
  for (int i = 0; i < KMPC_MOTORS; i++) {
    noInterrupts();
    wheels.count[i] = counts[i];
    interrupts();
    wheels.speed[i] = (int32_t)((float)(wheels.count[i] - last_count[i]) / seconds);
    last_count[i] = wheels.count[i];
    if (!wheels.driven || wheels.target[i] == 0) {
      integral[i] = 0.0f;
      kmpc_watch(&wheels, i, false, now);
      power(i, 0.0f); /* both inputs low: most H-bridges coast or brake; see yours */
      continue;
    }
    float error = (float)(wheels.target[i] - wheels.speed[i]) / TOP_SPEED;
    integral[i] = constrain(integral[i] + I_GAIN * error * seconds, -1.0f, 1.0f);
    float share = (float)wheels.target[i] / TOP_SPEED + P_GAIN * error + integral[i];
    kmpc_watch(&wheels, i, share >= TURNS_AT || share <= -TURNS_AT, now);
    power(i, wheels.dead ? 0.0f : share);
  }
}

void loop() {
  char reply[KMPC_LONGEST_REPLY];
  unsigned long now = millis();
  while (Serial.available() > 0) {
    int length = kmpc_feed(&wheels, (char)Serial.read(), now, reply);
    if (length > 0) Serial.write((const uint8_t *)reply, (size_t)length);
  }
  bool stopped = STOP_PIN >= 0 && digitalRead(STOP_PIN) == LOW;
  wheels.faults = (uint8_t)((stopped ? KMPC_STOPPED : 0) | (wheels.dead ? KMPC_ENCODER : 0));
  kmpc_check(&wheels, now);
#if KMPC_SERVO
  if (wheels.servo) servo.writeMicroseconds(wheels.servo); /* it stays where it is when the motors are let go */
#endif
  if (now - last_loop >= PERIOD) {
    speed_loop((float)(now - last_loop) / 1000.0f, now);
    last_loop = now;
  }
}
