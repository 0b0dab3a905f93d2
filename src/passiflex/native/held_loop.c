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
#include "callable.h"
#include "commands.h"

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
    double *work = input + n_u + n_s, *held = line + 1;
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
            control->arg[0] = y;
            control->arg[1] = c;
            control->arg[2] = row;
            control->arg[3] = p_control;
            control->res[0] = next;
            control->res[1] = command;
            control->res[2] = z;
            if (control->f(control->arg, control->res, control->iw, control->w, control->memory)) return k;
            for (long long i = 0; i < n_c; i++) c[i] = next[i];
            double* sent = command_sent(line, n_u, timing[2 * k]);
            for (long long i = 0; i < n_u; i++) sent[i] = command[i];
        }
        for (double t = 0.0;;) {
            commands_received(line, n_u, t, period);
            now = start;
            if (look && t == 0.0 && passiflex_remember(look, w, next_w, n_m)) return k;
            if (t == 0.0 && k % record_every == 0) {
                for (long long i = 0; i < n; i++) *out++ = y[i];
                for (long long i = 0; i < n_c; i++) *out++ = c[i];
                for (long long i = 0; i < n_u; i++) *out++ = held[i];
                for (long long i = 0; i < n_z; i++) *out++ = z[i];
            }
            if (k >= steps || t >= period) break;
            const double until = command_until(line, n_u, period);
            const long long count = even_steps(until - t, longest);
            for (long long i = 0; i < n_u; i++) input[i] = held[i];
            for (long long i = 0; i < n_s; i++) input[n_u + i] = row[i];
            const double h = (until - t) / count;
            for (long long i = 0; i < count; i++) {
                if (passiflex_step(plant, n_x, n_q, y, input, p_plant, h, work)) return k;
                now = start + (t + (i + 1) * h);
                if (look && passiflex_remember(glance, w, next_w, n_m)) return k;
            }
            t = until;
        }
        commands_later(line, n_u, period);
        for (long long i = 0; i < n; i++)
            if (!isfinite(y[i])) return k;
    }
    return n_rows;
}
