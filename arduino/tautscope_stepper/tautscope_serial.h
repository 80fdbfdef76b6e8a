/* The microcontroller's side of tautscope's serial line protocol, version 1 (docs/serial.md).
 *
 * C99 or C++, without libraries and allocation. Fill in `tautscope_board`, then
 *
 *     tautscope_init(&line, &board);
 *     for (;;) {
 *         while (a byte has come) tautscope_receive(&line, byte);
 *         tautscope_poll(&line);
 *     }
 *
 * All functions are called from this loop. It must come around every millisecond, or the watchdog is late.
 */
#ifndef TAUTSCOPE_SERIAL_H
#define TAUTSCOPE_SERIAL_H

#include <stdbool.h>
#include <stdint.h>

#define TAUTSCOPE_VERSION 1
#ifndef TAUTSCOPE_MOST_AXES
#define TAUTSCOPE_MOST_AXES 8 /* a smaller number saves memory */
#endif

enum { TAUTSCOPE_HELLO = 1, TAUTSCOPE_READ, TAUTSCOPE_ENABLE, TAUTSCOPE_SETPOINTS, TAUTSCOPE_STOP, TAUTSCOPE_DISABLE };
enum { TAUTSCOPE_ANSWER = 0x80 }; /* added to the kind of a request */
enum { TAUTSCOPE_DISABLED, TAUTSCOPE_ENABLED, TAUTSCOPE_STOPPED, TAUTSCOPE_SILENCE, TAUTSCOPE_FAULT };
enum { TAUTSCOPE_DONE, TAUTSCOPE_UNKNOWN, TAUTSCOPE_LENGTH, TAUTSCOPE_STATE, TAUTSCOPE_RANGE };
enum {
    TAUTSCOPE_NO_FAULT,
    TAUTSCOPE_DRIVER,
    TAUTSCOPE_HEAT,
    TAUTSCOPE_SUPPLY,
    TAUTSCOPE_LIMIT_SWITCH,
    TAUTSCOPE_ENCODER,
    TAUTSCOPE_STALL
};

enum {
    TAUTSCOPE_LONGEST_REQUEST = 3 + 4 * TAUTSCOPE_MOST_AXES + 2 + 1, /* message, CRC, first code byte */
    TAUTSCOPE_LONGEST_ANSWER = 5 + 12 * TAUTSCOPE_MOST_AXES + 2
};

typedef struct {
    int32_t lower, upper; /* range of targets [counts] */
    uint32_t speed;       /* largest speed [counts/s] */
} tautscope_axis;

/* What the microcontroller can do. */
typedef struct {
    uint8_t axes; /* 1 to TAUTSCOPE_MOST_AXES */
    tautscope_axis axis[TAUTSCOPE_MOST_AXES];
    void (*set_target)(uint8_t axis, int32_t counts); /* only while enabled, and within the range */
    int32_t (*position)(uint8_t axis);                /* [counts] */
    uint8_t (*fault)(uint8_t axis);                   /* TAUTSCOPE_NO_FAULT .., or a number of yours above 63 */
    void (*enable)(bool on);                          /* current on at the present position, or off */
    void (*stop)(void);                               /* stop all motors now, and hold them */
    void (*write)(const uint8_t *data, uint8_t size);
    uint32_t (*millis)(void); /* what it is wrong by, as 2 ms of Arduino's millis(), is added to the watchdog time */
} tautscope_board;

typedef struct {
    const tautscope_board *board;
    uint32_t heard_at;  /* last set-points [ms] */
    uint16_t watchdog;  /* [ms] */
    uint8_t state;
    uint8_t size;       /* of what has come of a frame; one more than the buffer if that is too long */
    uint8_t frame[TAUTSCOPE_LONGEST_REQUEST];
} tautscope_line;

/* CRC-16/IBM-3740, eight bits at a time: x^16 = x^12 + x^5 + 1. */
static inline uint16_t tautscope_crc(const uint8_t *data, uint8_t size) {
    uint16_t crc = 0xFFFF;
    for (uint8_t i = 0; i < size; i++) {
        uint8_t high = (uint8_t)(crc >> 8 ^ data[i]);
        high = (uint8_t)(high ^ high >> 4);
        crc = (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)(high << 12) ^ (uint16_t)(high << 5) ^ high);
    }
    return crc;
}

/* Encode by COBS, with the 0 at the end; at most 253 bytes, and `frame` has room for two more. */
static inline uint8_t tautscope_encode(const uint8_t *data, uint8_t size, uint8_t *frame) {
    uint8_t code_at = 0, end = 1;
    for (uint8_t i = 0; i < size; i++) {
        if (data[i]) {
            frame[end++] = data[i];
        } else {
            frame[code_at] = (uint8_t)(end - code_at);
            code_at = end++;
        }
    }
    frame[code_at] = (uint8_t)(end - code_at);
    frame[end++] = 0;
    return end;
}

/* Decode a frame without its 0, in place, and check its CRC; the size of the message, 0 if it is damaged. */
static inline uint8_t tautscope_decode(uint8_t *frame, uint8_t size) {
    uint8_t end = 0;
    for (uint8_t at = 0; at < size;) {
        uint8_t code = frame[at++];
        if (code - 1 > size - at) return 0;
        for (uint8_t i = 1; i < code; i++) frame[end++] = frame[at++];
        if (at < size) frame[end++] = 0;
    }
    if (end < 3) return 0;
    end = (uint8_t)(end - 2);
    return tautscope_crc(frame, end) == (uint16_t)(frame[end] | (uint16_t)frame[end + 1] << 8) ? end : 0;
}

static inline uint8_t tautscope_put(uint8_t *to, uint32_t value) {
    for (uint8_t i = 0; i < 4; i++) to[i] = (uint8_t)(value >> 8 * i);
    return 4;
}

static inline int32_t tautscope_get(const uint8_t *from) {
    uint32_t value = 0;
    for (uint8_t i = 0; i < 4; i++) value |= (uint32_t)from[i] << 8 * i;
    return (int32_t)value;
}

static inline void tautscope_init(tautscope_line *line, const tautscope_board *board) {
    line->board = board;
    line->state = TAUTSCOPE_DISABLED;
    line->size = 0;
}

static inline bool tautscope_has_fault(const tautscope_board *board) {
    for (uint8_t i = 0; i < board->axes; i++)
        if (board->fault(i)) return true;
    return false;
}

/* The error of a request; `body` is what follows kind and number. */
static inline uint8_t tautscope_serve(tautscope_line *line, uint8_t kind, const uint8_t *body, uint8_t size) {
    const tautscope_board *board = line->board;
    switch (kind) {
        case TAUTSCOPE_HELLO:
        case TAUTSCOPE_READ:
            return size ? TAUTSCOPE_LENGTH : TAUTSCOPE_DONE;
        case TAUTSCOPE_ENABLE: {
            if (size != 2) return TAUTSCOPE_LENGTH;
            uint16_t watchdog = (uint16_t)(body[0] | (uint16_t)body[1] << 8);
            if (watchdog == 0) return TAUTSCOPE_RANGE;
            if (line->state == TAUTSCOPE_FAULT || tautscope_has_fault(board)) return TAUTSCOPE_STATE;
            line->watchdog = watchdog;
            line->heard_at = board->millis();
            line->state = TAUTSCOPE_ENABLED;
            board->enable(true);
            return TAUTSCOPE_DONE;
        }
        case TAUTSCOPE_SETPOINTS:
            if (size != 4 * board->axes) return TAUTSCOPE_LENGTH;
            if (line->state != TAUTSCOPE_ENABLED) return TAUTSCOPE_STATE;
            for (uint8_t i = 0; i < board->axes; i++) {
                int32_t target = tautscope_get(body + 4 * i);
                if (target < board->axis[i].lower || target > board->axis[i].upper) return TAUTSCOPE_RANGE;
            }
            for (uint8_t i = 0; i < board->axes; i++) board->set_target(i, tautscope_get(body + 4 * i));
            line->heard_at = board->millis();
            return TAUTSCOPE_DONE;
        case TAUTSCOPE_STOP:
            if (size) return TAUTSCOPE_LENGTH;
            if (line->state == TAUTSCOPE_ENABLED) board->stop();
            if (line->state == TAUTSCOPE_ENABLED || line->state == TAUTSCOPE_SILENCE) line->state = TAUTSCOPE_STOPPED;
            return TAUTSCOPE_DONE;
        case TAUTSCOPE_DISABLE:
            if (size) return TAUTSCOPE_LENGTH;
            if (line->state == TAUTSCOPE_ENABLED) board->stop();
            board->enable(false);
            line->state = TAUTSCOPE_DISABLED;
            return TAUTSCOPE_DONE;
        default:
            return TAUTSCOPE_UNKNOWN;
    }
}

static inline void tautscope_answer(tautscope_line *line, const uint8_t *request, uint8_t error) {
    const tautscope_board *board = line->board;
    uint8_t answer[TAUTSCOPE_LONGEST_ANSWER], frame[TAUTSCOPE_LONGEST_ANSWER + 2], size = 5;
    bool is_hello = request[0] == TAUTSCOPE_HELLO && error == TAUTSCOPE_DONE;
    answer[0] = (uint8_t)(request[0] | TAUTSCOPE_ANSWER);
    answer[1] = request[1];
    answer[2] = request[2];
    answer[3] = is_hello ? TAUTSCOPE_VERSION : line->state;
    answer[4] = is_hello ? board->axes : error;
    for (uint8_t i = 0; i < board->axes; i++) {
        if (is_hello) {
            size = (uint8_t)(size + tautscope_put(answer + size, (uint32_t)board->axis[i].lower));
            size = (uint8_t)(size + tautscope_put(answer + size, (uint32_t)board->axis[i].upper));
            size = (uint8_t)(size + tautscope_put(answer + size, board->axis[i].speed));
        } else {
            answer[size++] = board->fault(i);
            size = (uint8_t)(size + tautscope_put(answer + size, (uint32_t)board->position(i)));
        }
    }
    uint16_t crc = tautscope_crc(answer, size);
    answer[size++] = (uint8_t)crc;
    answer[size++] = (uint8_t)(crc >> 8);
    board->write(frame, tautscope_encode(answer, size, frame));
}

/* Stop the motors after silence, or if one has a fault; call it every millisecond at least. */
static inline void tautscope_poll(tautscope_line *line) {
    const tautscope_board *board = line->board;
    uint8_t state = line->state;
    if (state == TAUTSCOPE_FAULT || state == TAUTSCOPE_DISABLED) return;
    if (tautscope_has_fault(board)) state = TAUTSCOPE_FAULT;
    if (state == TAUTSCOPE_ENABLED && board->millis() - line->heard_at >= line->watchdog) state = TAUTSCOPE_SILENCE;
    if (state == line->state) return;
    if (line->state == TAUTSCOPE_ENABLED) board->stop();
    line->state = state;
}

/* Take a byte from the line, and answer the request that it completes. */
static inline void tautscope_receive(tautscope_line *line, uint8_t byte) {
    if (byte) {
        if (line->size < sizeof line->frame) line->frame[line->size] = byte;
        if (line->size <= sizeof line->frame) line->size++;
        return;
    }
    uint8_t size = line->size > sizeof line->frame ? 0 : tautscope_decode(line->frame, line->size);
    line->size = 0;
    if (size < 3 || line->frame[0] >= TAUTSCOPE_ANSWER) return;
    tautscope_poll(line);
    tautscope_answer(line, line->frame, tautscope_serve(line, line->frame[0], line->frame + 3, (uint8_t)(size - 3)));
}

#endif
