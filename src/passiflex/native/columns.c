/* Evaluate one generated function at n points.
 *
 * Input i of point k starts at from[i] + k*step_from[i] (step 0: the same for all points);
 * output j goes to to[j] + k*step_to[j]. arg, res, iw, w are the function's own work arrays.
 * Returns the number of points done: n, or the first point at which the function failed. */
typedef int (*passiflex_generated)(const double** arg, double** res, long long* iw, double* w, int memory);

CASADI_SYMBOL_EXPORT long long passiflex_columns(
    passiflex_generated f, int memory, long long n_in, long long n_out, long long n,
    const double* const* from, const long long* step_from, double* const* to, const long long* step_to,
    const double** arg, double** res, long long* iw, double* w)
{
    for (long long k = 0; k < n; k++) {
        for (long long i = 0; i < n_in; i++) arg[i] = from[i] + k * step_from[i];
        for (long long j = 0; j < n_out; j++) res[j] = to[j] + k * step_to[j];
        if (f(arg, res, iw, w, memory)) return k;
    }
    return n;
}
