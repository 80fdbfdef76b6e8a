/* An ATmega328P at 16 MHz in simavr, for ctypes: a serial line in and out, and its step pins, in simulated time. */
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <string.h>

enum { MHZ = 16, ROOM = 4096 };

static avr_t *avr;
static uint8_t out[ROOM];
static unsigned out_end, steps;
static uint64_t stepped_at;

static void sent(struct avr_irq_t *irq, uint32_t value, void *param) {
    if (out_end < ROOM) out[out_end++] = (uint8_t)value;
}

static void stepped(struct avr_irq_t *irq, uint32_t value, void *param) {
    if (!value) return;
    steps++;
    stepped_at = avr->cycle;
}

int board_open(const char *file) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(file, &firmware)) return 1;
    avr = avr_make_mcu_by_name("atmega328p");
    if (!avr || avr_init(avr)) return 2;
    avr->log = LOG_NONE;
    avr->frequency = MHZ * 1000000;
    avr_load_firmware(avr, &firmware);
    out_end = steps = 0;
    stepped_at = 0;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
    for (int pin = 2; pin <= 4; pin++)
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), pin), stepped, NULL);
    return 0;
}

void board_close(void) { avr_terminate(avr); }

/* Send at most 64 bytes, which come at the line's bit rate. */
void board_write(const uint8_t *data, unsigned size) {
    for (unsigned i = 0; i < size; i++)
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), data[i]);
}

/* Run for a time [us], or until a frame has come from the board; 0 if the processor stopped. */
int board_run(unsigned microseconds, int until_frame) {
    uint64_t end = avr->cycle + (uint64_t)microseconds * MHZ;
    unsigned before = out_end;
    while (avr->cycle < end) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 0;
        if (until_frame && out_end > before && !out[out_end - 1]) break;
    }
    return 1;
}

/* Take what the board has sent; the number of bytes. */
unsigned board_read(uint8_t *data) {
    unsigned size = out_end;
    memcpy(data, out, size);
    out_end = 0;
    return size;
}

double board_time(void) { return avr->cycle / (MHZ * 1e6); }
double board_last_step(void) { return stepped_at / (MHZ * 1e6); }
unsigned board_steps(void) { return steps; }
