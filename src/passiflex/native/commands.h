/* The commands of one robot: the one in force, and those on their way.
 *
 * line holds their number, the one in force (n numbers), then (time left, command) of each, the oldest first. They
 * arrive in order: a command that would overtake the one before arrives with it. */

/* Put one more on its way, and return where its n numbers go. */
static double* command_sent(double* line, long long n, double delay)
{
    const long long waiting = (long long)line[0];
    double* last = line + 1 + n + waiting * (n + 1);
    last[0] = waiting && last[-(n + 1)] > delay ? last[-(n + 1)] : delay;
    line[0] = (double)(waiting + 1);
    return last + 1;
}

/* Take what has arrived `now` after the sample. */
static void commands_received(double* line, long long n, double now, double period)
{
    double* queue = line + 1 + n;
    long long waiting = (long long)line[0];
    while (waiting && queue[0] <= now + 1e-9 * period) {
        for (long long i = 0; i < n; i++) line[1 + i] = queue[1 + i];
        waiting--;
        for (long long i = 0; i < waiting * (n + 1); i++) queue[i] = queue[i + n + 1];
    }
    line[0] = (double)waiting;
}

/* Return until when the one in force stays so, the end of the period at most. */
static double command_until(const double* line, long long n, double period)
{
    return line[0] != 0.0 && line[1 + n] < period ? line[1 + n] : period;
}

/* Let a period pass. */
static void commands_later(double* line, long long n, double period)
{
    for (long long i = 0; i < (long long)line[0]; i++) line[1 + n + i * (n + 1)] -= period;
}

/* Return the number of equal steps over a span, none longer than `longest`. */
static long long even_steps(double span, double longest)
{
    const long long count = (long long)ceil(span / longest * (1.0 - 1e-12));
    return count < 1 ? 1 : count;
}
