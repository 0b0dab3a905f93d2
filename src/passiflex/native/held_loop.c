/* A sampled loop: a generated control function once per period, a generated plant under held commands.
 *
 * control(x, c, row, p) -> (c, command, z) and plant(x, [command, environment], p) -> (dx, dquad).
 * Row i of rows (n_w numbers, the first n_s of them the environment that the plant feels) holds during
 * period i. timing holds two numbers per row: the delay after which the command of this sample reaches the
 * plant, and whether the controller runs at all (0: a missed period, all stays as it was). Commands arrive
 * in order. line holds the commands on their way: their number, the one in force, then (time left, command)
 * for each; it goes in and comes out, as do y = (x, quad), c, and z, the signals of the last sample. Between two arrivals the plant takes equal
 * Runge-Kutta steps of order 4, none longer than `longest`.
 * out receives (x, quad, c, command in force, z) at every record_every-th sample, taken after control ran;
 * a row more than steps means one last sample without a period after it.
 * A watch, if there is one, remembers w: look(w, time, y, command in force, c, z, p) -> w sees every sample after
 * control ran, and glance(w, time, y, p) -> w the end of every step of the plant. Nothing is allocated here.
 * Returns the number of samples done: n_rows, or the first at which a number was not finite. */
typedef struct {
    int (*f)(const double** arg, double** res, long long* iw, double* w, int memory);
    int memory;
    const double** arg;
    double** res;
    long long* iw;
    double* w;
} passiflex_callable;

static int passiflex_plant_step(
    const passiflex_callable* plant, long long n_x, long long n_q, double* y, const double* input,
    const double* p, double h, double* scratch)
{
    static const double node[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    const long long n = n_x + n_q;
    double *stage = scratch, *slope = stage + n, *sum = slope + n;
    for (long long i = 0; i < n; i++) sum[i] = 0.0;
    for (int s = 0; s < 4; s++) {
        for (long long i = 0; i < n_x; i++) stage[i] = s ? y[i] + h * node[s] * slope[i] : y[i];
        plant->arg[0] = stage;
        plant->arg[1] = input;
        plant->arg[2] = p;
        plant->res[0] = slope;
        plant->res[1] = slope + n_x;
        if (plant->f(plant->arg, plant->res, plant->iw, plant->w, plant->memory)) return 1;
        for (long long i = 0; i < n; i++) sum[i] += weight[s] * slope[i];
    }
    for (long long i = 0; i < n; i++) y[i] += h * sum[i];
    return 0;
}

/* Let a function of a watch remember w of n_w numbers; next has room for as many. */
static int passiflex_remember(const passiflex_callable* f, double* w, double* next, long long n_w)
{
    f->arg[0] = w;
    f->res[0] = next;
    if (f->f(f->arg, f->res, f->iw, f->w, f->memory)) return 1;
    for (long long i = 0; i < n_w; i++) w[i] = next[i];
    return 0;
}

CASADI_SYMBOL_EXPORT long long passiflex_held_loop(
    const passiflex_callable* plant, const passiflex_callable* control,
    const passiflex_callable* look, const passiflex_callable* glance,
    const long long* sizes, double* y, double* c, double* line, double* z, double* w,
    const double* rows, const double* timing, const double* p_plant, const double* p_control, const double* p_watch,
    long long first, long long n_rows, long long steps, double period, double longest, long long record_every,
    double* out, double* scratch)
{
    const long long n_x = sizes[0], n_q = sizes[1], n_c = sizes[2], n_u = sizes[3];
    const long long n_w = sizes[4], n_s = sizes[5], n_z = sizes[6], n = n_x + n_q;
    const long long n_m = sizes[7];
    const long long width = n + n_c + n_u + n_z;
    double *next = scratch, *command = next + n_c, *input = command + n_u;
    double *work = input + n_u + n_s, *held = line + 1, *queue = held + n_u;
    const long long entry = n_u + 1;
    double now, *next_w = work + 3 * n;

    if (look) {
        look->arg[1] = glance->arg[1] = &now;
        look->arg[2] = glance->arg[2] = y;
        look->arg[3] = held;
        look->arg[4] = c;
        look->arg[5] = z;
        look->arg[6] = glance->arg[3] = p_watch;
    }

    for (long long k = 0; k < n_rows; k++) {
        const double *row = rows + k * n_w, start = (double)(first + k) * period;
        if (timing[2 * k + 1] != 0.0) {
            long long waiting = (long long)line[0];
            double arrival = timing[2 * k];
            control->arg[0] = y;
            control->arg[1] = c;
            control->arg[2] = row;
            control->arg[3] = p_control;
            control->res[0] = next;
            control->res[1] = command;
            control->res[2] = z;
            if (control->f(control->arg, control->res, control->iw, control->w, control->memory)) return k;
            for (long long i = 0; i < n_c; i++) c[i] = next[i];
            if (waiting && queue[(waiting - 1) * entry] > arrival) arrival = queue[(waiting - 1) * entry];
            queue[waiting * entry] = arrival;
            for (long long i = 0; i < n_u; i++) queue[waiting * entry + 1 + i] = command[i];
            line[0] = (double)(waiting + 1);
        }
        for (double t = 0.0;;) {
            long long waiting = (long long)line[0];
            double until;
            while (waiting && queue[0] <= t + 1e-9 * period) { /* the oldest command arrives */
                for (long long i = 0; i < n_u; i++) held[i] = queue[1 + i];
                waiting--;
                for (long long i = 0; i < waiting * entry; i++) queue[i] = queue[i + entry];
            }
            line[0] = (double)waiting;
            now = start;
            if (look && t == 0.0 && passiflex_remember(look, w, next_w, n_m)) return k;
            if (t == 0.0 && k % record_every == 0) {
                for (long long i = 0; i < n; i++) *out++ = y[i];
                for (long long i = 0; i < n_c; i++) *out++ = c[i];
                for (long long i = 0; i < n_u; i++) *out++ = held[i];
                for (long long i = 0; i < n_z; i++) *out++ = z[i];
            }
            if (k >= steps || t >= period) break;
            until = waiting && queue[0] < period ? queue[0] : period;
            long long count = (long long)ceil((until - t) / longest * (1.0 - 1e-12));
            if (count < 1) count = 1;
            for (long long i = 0; i < n_u; i++) input[i] = held[i];
            for (long long i = 0; i < n_s; i++) input[n_u + i] = row[i];
            const double h = (until - t) / count;
            for (long long i = 0; i < count; i++) {
                if (passiflex_plant_step(plant, n_x, n_q, y, input, p_plant, h, work)) return k;
                now = start + (t + (i + 1) * h);
                if (look && passiflex_remember(glance, w, next_w, n_m)) return k;
            }
            t = until;
        }
        for (long long i = 0; i < (long long)line[0]; i++) queue[i * entry] -= period;
        for (long long i = 0; i < n; i++)
            if (!isfinite(y[i])) return k;
    }
    return n_rows;
}
