/* Three step and direction drivers (A4988, DRV8825, TMC2209) on an Arduino Uno with a CNC shield: tautscope's serial
 * line, see docs/serial.md. A count is a step. Position 0 is where each motor was when the board got its power.
 *
 * For motors of another kind replace everything above `board`: see tautscope_serial.h. */
#define TAUTSCOPE_MOST_AXES 3
#include "tautscope_serial.h"

const uint32_t BIT_RATE = 250000;  // which 16 MHz divide exactly
const uint16_t TICK_RATE = 20000;  // timer interrupts per second
const uint16_t LONGEST_MOVE = TICK_RATE / 20;
const uint8_t AXES = 3, STEP_PIN = 2, DIRECTION_PIN = 5, ENABLE_PIN = 8;  // of the first axis; enabled while low
const uint8_t STEP_BITS = 0b00011100;  // pins 2 to 4, all on port D

struct Motor {
  int32_t position;
  uint16_t left;         // steps to the target
  uint16_t rate, phase;  // of a step per tick: 2^16 is one
  bool is_forward;
};
volatile Motor motors[AXES];
volatile uint16_t ticks;  // since the last set-points
volatile uint32_t milliseconds;
uint16_t interval;  // in which the next set-points are expected [ticks]; 0 before the first

// Move each motor by at most one step. Steps are spread over the time between two set-points.
ISR(TIMER1_COMPA_vect) {
  PORTD &= ~STEP_BITS;  // ends the pulses of the tick before
  if (ticks < 0xFFFF) ticks++;
  static uint8_t part;
  if (++part == TICK_RATE / 1000) {
    part = 0;
    milliseconds++;
  }
  for (uint8_t i = 0; i < AXES; i++) {
    volatile Motor &motor = motors[i];
    if (motor.left == 0) continue;
    uint16_t before = motor.phase, phase = before + motor.rate;
    motor.phase = phase;
    if (phase >= before) continue;  // no overflow yet
    PORTD |= 1 << (STEP_PIN + i);
    motor.left--;
    motor.position += motor.is_forward ? 1 : -1;
  }
}

int32_t position(uint8_t axis) {
  noInterrupts();
  int32_t at = motors[axis].position;
  interrupts();
  return at;
}

void set_target(uint8_t axis, int32_t counts) {
  if (axis == 0) {
    noInterrupts();
    uint16_t since = ticks;
    ticks = 0;
    interrupts();
    if (since > LONGEST_MOVE) since = interval ? LONGEST_MOVE : 0;
    // Those that come soon after late ones are no reason to hurry.
    interval = max(since, interval - interval / 8);
  }
  uint16_t duration = interval ? interval : LONGEST_MOVE;
  int32_t distance = counts - position(axis);
  uint16_t left = min(labs(distance), 0xFFFFL);
  // Half a step more, so that the last one comes in time; at most a step every other tick.
  uint16_t rate = left >= duration / 2 ? 0x8000 : ((2L * left + 1) * 0x8000) / duration;
  noInterrupts();
  motors[axis].left = left;
  motors[axis].rate = rate;
  motors[axis].is_forward = distance > 0;
  digitalWrite(DIRECTION_PIN + axis, distance > 0);
  interrupts();
}

void stop() {
  noInterrupts();
  for (uint8_t i = 0; i < AXES; i++) motors[i].left = 0;
  interrupts();
}

void enable(bool on) {
  stop();
  interval = 0;
  digitalWrite(ENABLE_PIN, on ? LOW : HIGH);
}

uint8_t fault(uint8_t) { return TAUTSCOPE_NO_FAULT; }  // these drivers report none

void send(const uint8_t *data, uint8_t size) { Serial.write(data, size); }

uint32_t now() {
  noInterrupts();
  uint32_t at = milliseconds;
  interrupts();
  return at;
}

const tautscope_board board = {
    AXES,
    {{-2000000, 2000000, TICK_RATE / 2}, {-2000000, 2000000, TICK_RATE / 2}, {-2000000, 2000000, TICK_RATE / 2}},
    set_target, position, fault, enable, stop, send, now,
};
tautscope_line line;

void setup() {
  digitalWrite(ENABLE_PIN, HIGH);
  pinMode(ENABLE_PIN, OUTPUT);
  for (uint8_t i = 0; i < AXES; i++) {
    pinMode(STEP_PIN + i, OUTPUT);
    pinMode(DIRECTION_PIN + i, OUTPUT);
  }
  TCCR1A = 0;
  TCCR1B = bit(WGM12) | bit(CS10);  // from 0 to OCR1A
  OCR1A = F_CPU / TICK_RATE - 1;
  TIMSK1 = bit(OCIE1A);
  Serial.begin(BIT_RATE);
  tautscope_init(&line, &board);
}

void loop() {
  while (Serial.available()) tautscope_receive(&line, Serial.read());
  tautscope_poll(&line);
}
