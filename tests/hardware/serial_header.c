/* The microcontroller's header on this computer, for ctypes: motors that stand where the test puts them. */
#include "../../arduino/tautscope_stepper/tautscope_serial.h"

enum { ROOM = 8192 };

int32_t targets[TAUTSCOPE_MOST_AXES], positions[TAUTSCOPE_MOST_AXES];
uint8_t faults[TAUTSCOPE_MOST_AXES], sent[ROOM];
uint32_t sent_size, now;
tautscope_board board;
tautscope_line line;

static void set_target(uint8_t axis, int32_t counts) { targets[axis] = counts; }
static int32_t position(uint8_t axis) { return positions[axis]; }
static uint8_t fault(uint8_t axis) { return faults[axis]; }
static void stop(void) {
    for (uint8_t i = 0; i < TAUTSCOPE_MOST_AXES; i++) targets[i] = positions[i];
}
static void enable(bool on) { (void)on, stop(); }
static void send(const uint8_t *data, uint8_t size) {
    for (uint8_t i = 0; i < size && sent_size < ROOM; i++) sent[sent_size++] = data[i];
}
static uint32_t milliseconds(void) { return now; }

void begin(uint8_t axes, const tautscope_axis *axis) {
    board.axes = axes;
    for (uint8_t i = 0; i < axes; i++) board.axis[i] = axis[i], faults[i] = 0, positions[i] = targets[i] = 0;
    board.set_target = set_target, board.position = position, board.fault = fault;
    board.enable = enable, board.stop = stop, board.write = send, board.millis = milliseconds;
    now = sent_size = 0;
    tautscope_init(&line, &board);
}

void receive(const uint8_t *data, uint32_t size) {
    for (uint32_t i = 0; i < size; i++) tautscope_receive(&line, data[i]);
}

void poll(void) { tautscope_poll(&line); }

uint8_t state(void) { return line.state; }

uint8_t encode(const uint8_t *data, uint8_t size, uint8_t *frame) { return tautscope_encode(data, size, frame); }

uint8_t decode(uint8_t *frame, uint8_t size) { return tautscope_decode(frame, size); }
