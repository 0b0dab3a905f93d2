/* One step of the classical Runge-Kutta method of order 4, over numbers or lanes.
 *
 * (y, quad) has n entries, of which the first n_x act back. `slopes` makes slope of stage, (dx, dquad), and may leave;
 * stage has n_x entries, slope and sum have n. After it y has not moved: what it is moved by is h times sum. */
#define RUNGE_KUTTA_STAGES(n_x, n, y, h, zero, stage, slope, sum, slopes)                                   \
    do {                                                                                                    \
        static const double node[4] = {0.0, 0.5, 0.5, 1.0};                                                 \
        static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};                       \
        for (long long i = 0; i < (n); i++) (sum)[i] = (zero);                                              \
        for (int s = 0; s < 4; s++) {                                                                       \
            for (long long i = 0; i < (n_x); i++)                                                           \
                (stage)[i] = s ? (y)[i] + (h) * node[s] * (slope)[i] : (y)[i];                              \
            slopes;                                                                                         \
            for (long long i = 0; i < (n); i++) (sum)[i] += weight[s] * (slope)[i];                         \
        }                                                                                                   \
    } while (0)
