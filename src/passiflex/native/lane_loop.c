/* The loop of held_loop.c for several robots side by side, each in its own lane.
 *
 * The text before this one defines, for lanes, the generated functions and their sizes:
 *   PLANT(x, [command, environment], p) -> (dx, dquad)      CONTROL(x, c, row, p) -> (c, command, z)
 *   ROW(time, scheduled, drawn) -> row                            TRUTH(x, command, environment, p) -> truth
 *   LOOK(w, time, y, command in force, c, z, p) -> w and GLANCE(w, time, y, p) -> w, if N_M is not 0, as in held_loop.c
 * What is scheduled to a lane changes at single periods (changes, in the order of periods: period, lane, and where
 * in scheduled_values its numbers stand); drawn are the numbers that chance gives to each period. timing holds for
 * each period and lane the delay of the command and whether the controller runs. Each lane keeps its own line
 * of commands on their way, its own longest step, and steps from arrival to arrival just as it would alone;
 * a lane that has finished its period waits for the others.
 * out receives, at every record_every-th sample, the numbers `kept` of (x, quad, c, command in force, z,
 * truth, row). Nothing is allocated here. A lane whose y leaves the finite numbers goes on as it is, and
 * disturbs no other; completed[lane] is the sample at which that happened, else n_rows; whole[lane] is how
 * many recorded samples came before the first of which any number, kept or not, is not finite. */
#include "commands.h"
#include "runge_kutta.h"

typedef struct {
    long long first, n_rows, steps, record_every, n_changes, n_kept;
    double period;
    lanes *y, *c, *scheduled, *z, *w;
    double *line, *longest;
    const long long* changes;
    const double* scheduled_values;
    const lanes* drawn;
    const double* timing;
    const lanes *p_plant, *p_control, *p_watch;
    const long long* kept;
    lanes* out;
    long long *completed, *whole;
} passiflex_lane_run;

enum { N_Y = N_X + N_Q, ENTRY = 1 + N_U, LINE = 1 + N_U + LONGEST_LINE * ENTRY,
       N_SEEN = N_Y + N_C + N_U + N_Z + N_TRUTH + N_W };

/* One lane's way through a period: where it is, and the equal steps to the next arrival. */
typedef struct {
    double t, h, until;
    long long left, done;
    int arrived; /* at the end of the period */
} lane_clock;

static void lane_step(lanes* y, const lanes* input, const lanes* p, lanes h, lane_bits moving)
{
    lanes stage[N_X], slope[N_Y], sum[N_Y];
    RUNGE_KUTTA_STAGES(N_X, N_Y, y, h, all_lanes(0.0), stage, slope, sum,
        PLANT(stage, input, p, slope, slope + N_X));
    for (int i = 0; i < N_Y; i++) y[i] = where(moving, y[i] + h * sum[i], y[i]);
}

/* Take what has arrived by now, and write the command in force into the lane. */
static void lane_receive(double* line, lanes* held, int l, double now, double period)
{
    commands_received(line, N_U, now, period);
    for (int i = 0; i < N_U; i++) LANE(held[i], l) = line[1 + i];
}

/* Plan the equal steps to a lane's next arrival, or to the end of its period. */
static void lane_plan(lane_clock* clock, const double* line, double period, double longest)
{
    clock->until = command_until(line, N_U, period);
    clock->left = even_steps(clock->until - clock->t, longest);
    clock->h = (clock->until - clock->t) / clock->left;
    clock->done = 0;
}

/* Let the watch see a sample, or a step, of those lanes that are seen. */
static void lane_look(const passiflex_lane_run* r, const lanes* held, lanes time, lane_bits seen)
{
#if N_M > 0
    lanes next[N_M];
    LOOK(r->w, &time, r->y, held, r->c, r->z, r->p_watch, next);
    for (int i = 0; i < N_M; i++) r->w[i] = where(seen, next[i], r->w[i]);
#endif
}

static void lane_glance(const passiflex_lane_run* r, lanes time, lane_bits seen)
{
#if N_M > 0
    lanes next[N_M];
    GLANCE(r->w, &time, r->y, r->p_watch, next);
    for (int i = 0; i < N_M; i++) r->w[i] = where(seen, next[i], r->w[i]);
#endif
}

/* The lanes whose numbers are all finite: what has left them is not watched any more. */
static lane_bits lane_whole(const lanes* y)
{
    lane_bits whole = all_bits(-1);
    for (int i = 0; i < N_Y; i++) EACH_LANE if (!isfinite(LANE(y[i], l))) LANE(whole, l) = 0;
    return whole;
}

static void lane_period(const passiflex_lane_run* r, lanes* input, double start, lane_bits whole)
{
    lane_clock clock[LANES];
    EACH_LANE
    {
        clock[l] = (lane_clock){0.0, 0.0, 0.0, 0, 0, 0};
        lane_plan(&clock[l], r->line + l * LINE, r->period, r->longest[l]);
    }
    for (;;) {
        lanes h = all_lanes(0.0), time = all_lanes(start);
        lane_bits moving = all_bits(0);
        int some = 0;
        EACH_LANE if (!clock[l].arrived)
        {
            LANE(h, l) = clock[l].h;
            LANE(time, l) = start + (clock[l].t + (++clock[l].done) * clock[l].h);
            LANE(moving, l) = -1;
            some = 1;
        }
        if (!some) return;
        lane_step(r->y, input, r->p_plant, h, moving);
        lane_glance(r, time, moving & whole);
        EACH_LANE if (!clock[l].arrived && --clock[l].left == 0)
        {
            double* line = r->line + l * LINE;
            clock[l].t = clock[l].until;
            if (clock[l].t >= r->period) {
                clock[l].arrived = 1;
            } else {
                lane_receive(line, input, l, clock[l].t, r->period);
                lane_plan(&clock[l], line, r->period, r->longest[l]);
            }
        }
    }
}

LANE_EXPORT int passiflex_lanes(void) { return LANES; }

LANE_EXPORT void passiflex_lane_loop(const passiflex_lane_run* r)
{
    lanes next[N_C], command[N_U], said[N_Z], row[N_W], time, input[N_U + N_S];
    lanes seen[N_SEEN], none = all_lanes(0.0); /* NaN once a number was not finite */
    const long long* change = r->changes;
    lanes* out = r->out;
    lane_bits whole = lane_whole(r->y);
    EACH_LANE r->completed[l] = r->n_rows, r->whole[l] = 0;
    for (long long k = 0; k < r->n_rows; k++) {
        const double* timing = r->timing + k * 2 * LANES;
        lane_bits runs;
        for (; change < r->changes + 3 * r->n_changes && change[0] <= r->first + k; change += 3)
            for (int i = 0; i < N_SCHEDULED; i++) LANE(r->scheduled[i], change[1]) = r->scheduled_values[change[2] * N_SCHEDULED + i];
        time = all_lanes((double)(r->first + k) * r->period);
        ROW(&time, r->scheduled, r->drawn + k * N_DRAWN, row);
        CONTROL(r->y, r->c, row, r->p_control, next, command, said);
        EACH_LANE LANE(runs, l) = timing[LANES + l] != 0.0 ? -1 : 0;
        for (int i = 0; i < N_C; i++) r->c[i] = where(runs, next[i], r->c[i]);
        for (int i = 0; i < N_Z; i++) r->z[i] = where(runs, said[i], r->z[i]);
        for (int i = 0; i < N_S; i++) input[N_U + i] = row[i];
        EACH_LANE
        {
            if (timing[LANES + l] != 0.0) {
                double* sent = command_sent(r->line + l * LINE, N_U, timing[l]);
                for (int i = 0; i < N_U; i++) sent[i] = LANE(command[i], l);
            }
            lane_receive(r->line + l * LINE, input, l, 0.0, r->period);
        }
        lane_look(r, input, time, whole);
        if (k % r->record_every == 0) {
            lanes* s = seen;
            memcpy(s, r->y, N_Y * sizeof(lanes)), s += N_Y;
            memcpy(s, r->c, N_C * sizeof(lanes)), s += N_C;
            memcpy(s, input, N_U * sizeof(lanes)), s += N_U;
            memcpy(s, r->z, N_Z * sizeof(lanes)), s += N_Z;
            TRUTH(r->y, input, row, r->p_control, s), s += N_TRUTH;
            memcpy(s, row, N_W * sizeof(lanes));
            for (long long i = 0; i < r->n_kept; i++) *out++ = seen[r->kept[i]];
            for (int i = 0; i < N_SEEN; i++) none += 0.0 * seen[i];
            EACH_LANE r->whole[l] += LANE(none, l) == 0.0;
        }
        if (k >= r->steps) break;
        lane_period(r, input, (double)(r->first + k) * r->period, whole);
        int alive = 0;
        whole = lane_whole(r->y);
        EACH_LANE
        {
            commands_later(r->line + l * LINE, N_U, r->period);
            if (r->completed[l] < r->n_rows) continue;
            if (!LANE(whole, l)) r->completed[l] = k;
            alive |= LANE(whole, l) != 0;
        }
        if (!alive) return;
    }
}
