/* Classical Runge-Kutta of order 4 under held inputs, for a generated rhs(x, u, p) -> (dx, dquad).
 *
 * The extended state is (x, quad); quad does not act back on x. Row i of held (n_hold rows of n_u
 * numbers) is held during period i, which takes `substeps` steps of `length`; the first `refined` of
 * them are split into `split` equal ones, for what is fast after the input has jumped.
 * out receives the extended state at the start and after every `record_every` periods,
 * (n_hold / record_every + 1) rows in all. scratch holds 4*(n_x + n_q) numbers;
 * arg, res, iw, w are the work arrays of rhs. Nothing is allocated here.
 * Returns n_hold, or the first period after which a number is not finite (or in which rhs failed);
 * the rows from there on are NaN. */
typedef int (*passiflex_rhs)(const double** arg, double** res, long long* iw, double* w, int memory);

CASADI_SYMBOL_EXPORT long long passiflex_rk4(
    passiflex_rhs rhs, int memory, long long n_x, long long n_q, long long n_u,
    const double* start, const double* held, const double* p,
    long long n_hold, long long substeps, double length, long long refined, long long split,
    long long record_every, double* out,
    const double** arg, double** res, long long* iw, double* w, double* scratch)
{
    static const double node[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    const long long n = n_x + n_q;
    double *y = scratch, *stage = y + n, *slope = stage + n, *sum = slope + n;
    double *end = out + (n_hold / record_every + 1) * n;
    long long period;

    for (long long i = 0; i < n; i++) *out++ = y[i] = start[i];
    for (period = 0; period < n_hold; period++) {
        int bad = 0;
        long long fine = refined < substeps ? refined : substeps;
        long long steps = substeps + fine * (split - 1);
        for (long long step = 0; step < steps && !bad; step++) {
            double h = step < fine * split ? length / split : length;
            for (long long i = 0; i < n; i++) sum[i] = 0.0;
            for (int s = 0; s < 4 && !bad; s++) {
                for (long long i = 0; i < n_x; i++) stage[i] = s ? y[i] + h * node[s] * slope[i] : y[i];
                arg[0] = stage;
                arg[1] = held + period * n_u;
                arg[2] = p;
                res[0] = slope;
                res[1] = slope + n_x;
                bad = rhs(arg, res, iw, w, memory);
                for (long long i = 0; i < n; i++) sum[i] += weight[s] * slope[i];
            }
            for (long long i = 0; i < n; i++) y[i] += h * sum[i];
        }
        for (long long i = 0; i < n; i++) bad |= !isfinite(y[i]); /* once lost, a number never becomes finite again */
        if (bad) break;
        if ((period + 1) % record_every == 0)
            for (long long i = 0; i < n; i++) *out++ = y[i];
    }
    while (out < end) *out++ = NAN;
    return period;
}
