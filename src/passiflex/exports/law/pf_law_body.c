#include "pf_law.h"

#include <stddef.h>
#include <string.h>

#include "pf_law_functions.c"

/* Every struct of pf_law.h is numbers alone, in the order of the flat vectors that the functions take. */
#define FITS(type, count) typedef char fits_##type[sizeof(type) == (count) * sizeof(double) ? 1 : -1]
FITS(pf_law_said, PF_LAW_SAID);
FITS(pf_law_setpoint, PF_LAW_SETPOINT);
FITS(pf_law_memory, PF_LAW_MEMORY);
FITS(pf_law_numbers, PF_LAW_NUMBERS);
FITS(pf_law_signals, PF_LAW_SIGNALS);

static int begin(pf_law *law, const pf_law_said *said, double level)
{
    double measured[PF_LAW_MEASURED];
    const double *arg[3];
    double *res[3];
    arg[0] = (const double *)said;
    arg[1] = &level;
    arg[2] = (const double *)&law->numbers;
    res[0] = (double *)&law->memory;
    res[1] = (double *)&law->setpoint;
    res[2] = measured;
    law->asked = 0;
    return PF_LAW_BEGIN(arg, res);
}

int pf_law_init(pf_law *law, const pf_law_said *said)
{
    memset(law, 0, sizeof *law);
    law->numbers = pf_law_default_numbers;
    return begin(law, said, PF_LAW_LEVEL);
}

int pf_law_reset_at(pf_law *law, const pf_law_said *said, double level)
{
    return begin(law, said, level);
}

int pf_law_step(pf_law *law, const pf_law_said *said, const pf_law_setpoint *setpoint)
{
    pf_law_memory after;
    const double *arg[4];
    double *res[3];
    int failed;
    if (setpoint != NULL) {
        const double run = law->setpoint.run;
        if (setpoint != &law->setpoint) {
            law->setpoint = *setpoint;
        }
        law->setpoint.run = run;
        law->setpoint.fresh = 1.0;
        law->asked = 1;
    } else if (law->asked) {
        law->setpoint.fresh = 0.0;
    }
    arg[0] = (const double *)said;
    arg[1] = (const double *)&law->setpoint;
    arg[2] = (const double *)&law->memory;
    arg[3] = (const double *)&law->numbers;
    res[0] = (double *)&after;
    res[1] = law->torque;
    res[2] = (double *)&law->signals;
    failed = PF_LAW_STEP(arg, res);
    if (!failed) {
        law->memory = after;
    }
    return failed;
}

void pf_law_stop(pf_law *law)
{
    law->setpoint.run = 0.0;
}

void pf_law_resume(pf_law *law)
{
    law->setpoint.run = 1.0;
}

int pf_law_stopped(const pf_law *law)
{
    return law->setpoint.run == 0.0 && law->memory.scale == 0.0;
}
