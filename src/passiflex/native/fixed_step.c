/* Classical Runge-Kutta of order 4 under held inputs, for a generated rhs(x, u, p) -> (dx, dquad).
 *
 * The extended state is (x, quad); quad does not act back on x. Row i of held (n_hold rows of n_u
 * numbers) is held during period i, which takes `substeps` steps of `length`; the first `refined` of
 * them are split into `split` equal ones, for what is fast after the input has jumped.
 * watch(w, time, y, u, p_watch) -> w, if there is one, sees the start and the end of every step; the time is
 * `begin` at the start.
 * out receives the extended state at the start and after every `record_every` periods,
 * (n_hold / record_every + 1) rows in all. scratch holds 4*(n_x + n_q) + n_m numbers. Nothing is allocated here.
 * Returns n_hold, or the first period after which a number is not finite (or in which rhs failed);
 * the rows from there on are NaN. */
#include "callable.h"

/* Show a watch one instant; w is n_m numbers, next has room for as many. */
static int passiflex_look(
    const passiflex_callable* watch, long long n_m, double* w, double* next, double time,
    const double* y, const double* u, const double* p)
{
    if (!watch) return 0;
    watch->arg[1] = &time;
    watch->arg[2] = y;
    watch->arg[3] = u;
    watch->arg[4] = p;
    return passiflex_remember(watch, w, next, n_m);
}

/* Show a watch n_rows instants in a row: time i and row i of y, n numbers each. */
CASADI_SYMBOL_EXPORT long long passiflex_watch_rows(
    const passiflex_callable* watch, long long n_m, long long n, double* w, double* next,
    long long n_rows, const double* time, const double* y, const double* u, const double* p)
{
    for (long long i = 0; i < n_rows; i++)
        if (passiflex_look(watch, n_m, w, next, time[i], y + i * n, u, p)) return i;
    return n_rows;
}

CASADI_SYMBOL_EXPORT long long passiflex_rk4(
    const passiflex_callable* rhs, const passiflex_callable* watch,
    long long n_m, long long n_x, long long n_q, long long n_u,
    const double* start, const double* held, const double* p, double* w, const double* p_watch, double begin,
    long long n_hold, long long substeps, double length, long long refined, long long split,
    long long record_every, double* out, double* scratch)
{
    const long long n = n_x + n_q;
    double *y = scratch, *work = y + n, *next = work + 3 * n;
    double *end = out + (n_hold / record_every + 1) * n;
    long long period;

    for (long long i = 0; i < n; i++) *out++ = y[i] = start[i];
    if (n_hold && passiflex_look(watch, n_m, w, next, begin, y, held, p_watch)) n_hold = 0;
    for (period = 0; period < n_hold; period++) {
        const double *u = held + period * n_u, first = begin + period * (substeps * length);
        int bad = 0;
        long long fine = refined < substeps ? refined : substeps;
        long long steps = substeps + fine * (split - 1);
        for (long long step = 0; step < steps && !bad; step++) {
            double h = step < fine * split ? length / split : length;
            bad = passiflex_step(rhs, n_x, n_q, y, u, p, h, work);
            double t = step < fine * split ? (step + 1) * h : (fine + (step + 1 - fine * split)) * h;
            bad = bad || passiflex_look(watch, n_m, w, next, first + t, y, u, p_watch);
        }
        for (long long i = 0; i < n; i++) bad |= !isfinite(y[i]); /* once lost, a number never becomes finite again */
        if (bad) break;
        if ((period + 1) % record_every == 0)
            for (long long i = 0; i < n; i++) *out++ = y[i];
    }
    while (out < end) *out++ = NAN;
    return period;
}
