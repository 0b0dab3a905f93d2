/* A generated function with its memory, and a step of the plant or of a closed loop by it.
 *
 * f(x, u, p) -> (dx, dquad); scratch holds 3 (n_x + n_q) numbers. Returns 1 if f failed, and y stays as it was. */
#include "runge_kutta.h"

typedef struct {
    int (*f)(const double** arg, double** res, long long* iw, double* w, int memory);
    int memory;
    const double** arg;
    double** res;
    long long* iw;
    double* w;
} passiflex_callable;

static int passiflex_step(
    const passiflex_callable* f, long long n_x, long long n_q, double* y, const double* u, const double* p, double h,
    double* scratch)
{
    const long long n = n_x + n_q;
    double *stage = scratch, *slope = stage + n, *sum = slope + n;
    int failed = 0;
    f->arg[0] = stage;
    f->arg[1] = u;
    f->arg[2] = p;
    f->res[0] = slope;
    f->res[1] = slope + n_x;
    RUNGE_KUTTA_STAGES(n_x, n, y, h, 0.0, stage, slope, sum,
        if ((failed = f->f(f->arg, f->res, f->iw, f->w, f->memory))) break);
    if (failed) return 1;
    for (long long i = 0; i < n; i++) y[i] += h * sum[i];
    return 0;
}

/* Let a function of a watch remember w of n_w numbers, its first argument; next has room for as many. */
static int passiflex_remember(const passiflex_callable* f, double* w, double* next, long long n_w)
{
    f->arg[0] = w;
    f->res[0] = next;
    if (f->f(f->arg, f->res, f->iw, f->w, f->memory)) return 1;
    for (long long i = 0; i < n_w; i++) w[i] = next[i];
    return 0;
}
