/* Cycles of a step on an ATmega328P (Arduino Uno), counted by its timer 1. Prints the largest and the mean. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>
#include <stdlib.h>

#include HEADER

#define STEPS 200

static volatile uint16_t overflows;

ISR(TIMER1_OVF_vect) { ++overflows; }

static uint32_t cycles(void)
{
    uint16_t low = TCNT1;
    return ((uint32_t)overflows << 16) + low;
}

static void print(uint32_t number)
{
    char text[12];
    ultoa(number, text, 10);
    for (char *c = text; *c; ++c) {
        while (!(UCSR0A & (1 << UDRE0))) {}
        UDR0 = *c;
    }
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = '\n';
}

int main(void)
{
    STATE state;
    volatile float command = 0.0f;
    uint32_t most = 0, all = 0;
    UCSR0B = 1 << TXEN0;
    UBRR0 = 8;
    TCCR1B = 1 << CS10;
    TIMSK1 = 1 << TOIE1;
    sei();
    RESET(&state);
    for (int i = 0; i < STEPS; ++i) {
        float q1 = 0.0015f * (float)(i % 37 - 18), q2 = 0.0015f * (float)(i % 23 - 11);
        uint32_t before = cycles();
        command = STEP(&state, q1, q2, 0.0f);
        uint32_t taken = cycles() - before;
        if (taken > most) most = taken;
        all += taken;
    }
    (void)command;
    print(most);
    print(all / STEPS);
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}
