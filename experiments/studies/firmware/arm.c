/* Instructions of 1000 steps on a Cortex-M4F, in ticks of its SysTick timer. Prints the ticks by semihosting. */
#include <stdint.h>

#include HEADER

#define STEPS 1000
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define CPACR ((volatile uint32_t *)0xE000ED88)

static void host(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static __attribute__((noinline)) void work(void)
{
    STATE state;
    volatile float command = 0.0f;
    char text[12], *c = text + sizeof text;
    RESET(&state);
    SYSTICK[1] = 0xffffff;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    uint32_t before = SYSTICK[2];
    for (int i = 0; i < STEPS; ++i) {
        float q1 = 0.0015f * (float)(i % 37 - 18), q2 = 0.0015f * (float)(i % 23 - 11);
        command = STEP(&state, q1, q2, 0.0f);
    }
    uint32_t ticks = (before - SYSTICK[2]) & 0xffffff;
    (void)command;
    *--c = '\0';
    *--c = '\n';
    do {
        *--c = (char)('0' + ticks % 10);
        ticks /= 10;
    } while (ticks);
    host(0x04, c);
}

static void reset(void)
{
    *CPACR |= 0xFu << 20; /* the floating-point unit, before any of its registers is used */
    __asm__ volatile("dsb\n isb");
    work();
    host(0x18, (const void *)0x20026);
    for (;;) {}
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {(void *)0x20010000, reset};
