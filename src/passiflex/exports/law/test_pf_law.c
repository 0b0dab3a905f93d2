/* Steps the law through recorded rows and compares the torques with those of Python: make check. */
#include "pf_law.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int numbers(FILE *rows, double *into, int count)
{
    for (int i = 0; i < count; i++) {
        char word[64];
        if (fscanf(rows, "%63s", word) != 1) {
            return 0;
        }
        into[i] = strtod(word, NULL); /* hexadecimal, so to the last bit; nan as well */
    }
    return 1;
}

int main(int count, char **given)
{
    static pf_law law;
    pf_law_said said;
    pf_law_setpoint setpoint;
    double expected[PF_LAW_JOINTS], level, asked, worst = 0.0, worst_level = 0.0;
    const double allowed = count > 2 ? strtod(given[2], NULL) : 0.0;
    int steps = 0, different = 0;
    FILE *rows = count > 1 ? fopen(given[1], "r") : NULL;
    if (rows == NULL) {
        fprintf(stderr, "usage: test_pf_law ROWS [ALLOWED]\n");
        return 2;
    }
    while (numbers(rows, (double *)&said, PF_LAW_SAID)) {
        if (!numbers(rows, &asked, 1) || (steps == 0 && pf_law_init(&law, &said))) {
            return 2;
        }
        if (asked > 0) {
            setpoint = law.setpoint;
            if (!numbers(rows, setpoint.position, 3) || !numbers(rows, &setpoint.rotation[0][0], 9)
                || !numbers(rows, setpoint.velocity, 6)) {
                return 2;
            }
        }
        if (!numbers(rows, expected, PF_LAW_JOINTS) || !numbers(rows, &level, 1)) {
            return 2;
        }
        if (pf_law_step(&law, &said, asked > 0 ? &setpoint : NULL)) {
            return 2;
        }
        for (int i = 0; i < PF_LAW_JOINTS; i++) {
            different += memcmp(&law.torque[i], &expected[i], sizeof expected[i]) != 0;
            worst = fmax(worst, fabs(law.torque[i] - expected[i]));
        }
        worst_level = fmax(worst_level, fabs(law.memory.tank_energy - level));
        steps++;
    }
    fclose(rows);
    printf("%d steps, %d torques not equal to the last bit, largest difference %.3g N m, of the tank %.3g J\n",
           steps, different, worst, worst_level);
    return steps > 0 && worst <= allowed && worst_level <= allowed ? 0 : 1;
}
