/* A loop around the law: replace read_robot, write_robot and wait_for_period by those of your robot. */
#include "pf_law.h"

#include <math.h>
#include <stdio.h>
#include <time.h>

static void read_robot(pf_law_said *said)
{
    (void)said; /* a robot that stands where the scenario has it; write what yours says, in SI units */
}

static void write_robot(const double *torque)
{
    (void)torque;
}

int main(void)
{
    static pf_law law;
    pf_law_said said = pf_law_example_said;
    double total = 0.0, longest = 0.0;
    const int steps = 100000;
    read_robot(&said);
    if (pf_law_init(&law, &said)) {
        return 1;
    }
    for (int k = 0; k < steps; k++) {
        struct timespec begin, end;
        double taken;
        read_robot(&said);
        said.elapsed = PF_LAW_PERIOD; /* better: what your clock says */
        timespec_get(&begin, TIME_UTC);
        law.setpoint.velocity[2] = 0.01 * sin(6.28 * k * PF_LAW_PERIOD);
        if (pf_law_step(&law, &said, &law.setpoint)) {
            return 1;
        }
        timespec_get(&end, TIME_UTC);
        write_robot(law.torque);
        taken = 1e6 * (double)(end.tv_sec - begin.tv_sec) + 1e-3 * (double)(end.tv_nsec - begin.tv_nsec);
        total += taken;
        longest = fmax(longest, taken);
    }
    printf("%.2f us a step on average, %.0f us the longest, tank %.3f J\n", total / steps, longest,
           law.memory.tank_energy);
    return 0;
}
