/* Several doubles that go through the same instructions, one lane for each of several robots.
 *
 * LANES is 8 or 4 by what the processor has, and 1 where it has no wide registers or the compiler is told so.
 * Nothing here mixes lanes: a result does not depend on the lane it is in, nor on its neighbours. Comparisons
 * give 1.0 or 0.0, as in CasADi. sin, cos, exp and tanh are polynomials that all lanes share, right to 3 units
 * in the last place; what is rare is asked of the C library lane by lane. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#ifndef LANES
#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 1
#endif
#endif

#if LANES > 1
typedef double lanes __attribute__((vector_size(LANES * 8)));
typedef int64_t lane_bits __attribute__((vector_size(LANES * 8)));
#define LANE(v, l) ((v)[l])
#define COMPARED(a, op, b) ((lane_bits)((a)op(b)))
#else
typedef double lanes;
typedef int64_t lane_bits;
#define LANE(v, l) (v)
#define COMPARED(a, op, b) (-(lane_bits)((a)op(b)))
#endif
#define LANE_EXPORT __attribute__((visibility("default")))
#define EACH_LANE for (int l = 0; l < LANES; l++)
#define INLINE static inline __attribute__((always_inline, unused))
#define ALONE static __attribute__((noinline, unused))

INLINE lane_bits as_bits(lanes v) { lane_bits r; memcpy(&r, &v, sizeof r); return r; }
INLINE lanes as_lanes(lane_bits v) { lanes r; memcpy(&r, &v, sizeof r); return r; }
INLINE lanes all_lanes(double v) { lanes r; EACH_LANE LANE(r, l) = v; return r; }
INLINE lane_bits all_bits(int64_t v) { lane_bits r; EACH_LANE LANE(r, l) = v; return r; }
INLINE lanes where(lane_bits mask, lanes a, lanes b) { return as_lanes((mask & as_bits(a)) | (~mask & as_bits(b))); }
INLINE lanes one_if(lane_bits mask) { return as_lanes(mask & as_bits(all_lanes(1.0))); }
INLINE lane_bits is_true(lanes a) { return COMPARED(a, !=, all_lanes(0.0)); }
INLINE int all_true(lane_bits mask) { int r = 1; EACH_LANE r &= LANE(mask, l) != 0; return r; }

INLINE lanes lanes_lt(lanes a, lanes b) { return one_if(COMPARED(a, <, b)); }
INLINE lanes lanes_le(lanes a, lanes b) { return one_if(COMPARED(a, <=, b)); }
INLINE lanes lanes_eq(lanes a, lanes b) { return one_if(COMPARED(a, ==, b)); }
INLINE lanes lanes_ne(lanes a, lanes b) { return one_if(COMPARED(a, !=, b)); }
INLINE lanes lanes_not(lanes a) { return one_if(~is_true(a)); }
INLINE lanes lanes_and(lanes a, lanes b) { return one_if(is_true(a) & is_true(b)); }
INLINE lanes lanes_or(lanes a, lanes b) { return one_if(is_true(a) | is_true(b)); }
INLINE lanes lanes_if_else_zero(lanes c, lanes a) { return as_lanes(is_true(c) & as_bits(a)); }
INLINE lanes lanes_fabs(lanes a) { return as_lanes(as_bits(a) & all_bits(INT64_MAX)); }
INLINE lane_bits sign_bit(lanes a) { return as_bits(a) & all_bits(INT64_MIN); }
/* What is zero or no number stays as it is. */
INLINE lanes lanes_sign(lanes a)
{
    return where(COMPARED(lanes_fabs(a), >, all_lanes(0.0)), as_lanes(sign_bit(a) | as_bits(all_lanes(1.0))), a);
}
/* As in C, a number wins over what is none. */
INLINE lanes lanes_fmin(lanes a, lanes b) { return where(COMPARED(a, <, b) | COMPARED(b, !=, b), a, b); }
INLINE lanes lanes_fmax(lanes a, lanes b) { return where(COMPARED(a, >, b) | COMPARED(b, !=, b), a, b); }

#define BY_LANE(f) \
    INLINE lanes lanes_##f(lanes a) { lanes r; EACH_LANE LANE(r, l) = f(LANE(a, l)); return r; }
#define BY_LANE_ALONE(f) \
    ALONE lanes lanes_##f(lanes a) { lanes r; EACH_LANE LANE(r, l) = f(LANE(a, l)); return r; }
#define BY_LANE_ALONE_2(f) \
    ALONE lanes lanes_##f(lanes a, lanes b) { lanes r; EACH_LANE LANE(r, l) = f(LANE(a, l), LANE(b, l)); return r; }
BY_LANE(sqrt)
BY_LANE(floor)
BY_LANE(ceil)
BY_LANE_ALONE(tan)
BY_LANE_ALONE(asin)
BY_LANE_ALONE(acos)
BY_LANE_ALONE(atan)
BY_LANE_ALONE(log)
BY_LANE_ALONE(sinh)
BY_LANE_ALONE(cosh)
BY_LANE_ALONE(erf)
BY_LANE_ALONE_2(atan2)
BY_LANE_ALONE_2(pow)
BY_LANE_ALONE_2(fmod)
BY_LANE_ALONE_2(copysign)
BY_LANE_ALONE_2(hypot)

/* Adding and subtracting 1.5 * 2^52 rounds to a whole number, whose last bits are then those of the sum. */
#define ROUNDER 0x1.8p52

/* sin and cos of x >= 0, x = k pi/2 + r, by their Taylor series in r, |r| <= pi/4; pi/2 in three parts of 33 bits.
 * quarter is what cos is ahead of sin: 1. */
INLINE lanes quarter_turns(lanes x, int64_t quarter)
{
    const lanes shifted = x * 0x1.45f306dc9c883p-1 + ROUNDER, k = shifted - ROUNDER;
    const lane_bits turn = as_bits(shifted) + all_bits(quarter);
    const lanes r = ((x - k * 0x1.921fb544p+0) - k * 0x1.0b4611a6p-34) - k * 0x1.3198a2e037073p-69;
    const lanes s = r * r;
    const lanes sine = r + r * s * (-1.0 / 6 + s * (1.0 / 120 + s * (-1.0 / 5040 + s * (1.0 / 362880
        + s * (-1.0 / 39916800 + s * (1.0 / 6227020800 + s * (-1.0 / 1307674368000)))))));
    const lanes cosine = 1.0 - 0.5 * s + s * s * (1.0 / 24 + s * (-1.0 / 720 + s * (1.0 / 40320 + s * (-1.0 / 3628800
        + s * (1.0 / 479001600 + s * (-1.0 / 87178291200 + s * (1.0 / 20922789888000)))))));
    const lanes value = where(COMPARED((turn & 1), ==, all_bits(0)), sine, cosine);
    return as_lanes(as_bits(value) ^ (-((turn >> 1) & 1) & all_bits(INT64_MIN)));
}
INLINE lane_bits moderate(lanes x) { return COMPARED(lanes_fabs(x), <=, all_lanes(1e5)); }
ALONE lanes library_sin(lanes x) { lanes r; EACH_LANE LANE(r, l) = sin(LANE(x, l)); return r; }
ALONE lanes library_cos(lanes x) { lanes r; EACH_LANE LANE(r, l) = cos(LANE(x, l)); return r; }
INLINE lanes lanes_sin(lanes x)
{
    const lane_bits easy = moderate(x);
    const lanes r = as_lanes(as_bits(quarter_turns(lanes_fabs(x), 0)) ^ sign_bit(x)); /* odd, down to -0 */
    return __builtin_expect(all_true(easy), 1) ? r : where(easy, r, library_sin(x));
}
INLINE lanes lanes_cos(lanes x)
{
    const lane_bits easy = moderate(x);
    const lanes r = quarter_turns(lanes_fabs(x), 1);
    return __builtin_expect(all_true(easy), 1) ? r : where(easy, r, library_cos(x));
}

/* exp(x) - 1 = 2^k (exp(r) - 1) + 2^k - 1 for x = k ln 2 + r, |r| <= ln 2 / 2, between -700 and 700. */
INLINE lanes grown(lanes x, lanes* power)
{
    const lanes shifted = x * 0x1.71547652b82fep+0 + ROUNDER, k = shifted - ROUNDER;
    const lanes r = (x - k * 0x1.62e42feep-1) - k * 0x1.a39ef35793c76p-33;
    *power = as_lanes((as_bits(shifted) + 1023) << 52);
    return r + r * r * (1.0 / 2 + r * (1.0 / 6 + r * (1.0 / 24 + r * (1.0 / 120 + r * (1.0 / 720 + r * (1.0 / 5040
        + r * (1.0 / 40320 + r * (1.0 / 362880 + r * (1.0 / 3628800 + r * (1.0 / 39916800
        + r * (1.0 / 479001600 + r * (1.0 / 6227020800))))))))))));
}
ALONE lanes library_exp(lanes x) { lanes r; EACH_LANE LANE(r, l) = exp(LANE(x, l)); return r; }
INLINE lanes lanes_exp(lanes x)
{
    const lane_bits easy = COMPARED(lanes_fabs(x), <=, all_lanes(700.0));
    lanes power;
    const lanes growth = grown(where(easy, x, all_lanes(0.0)), &power), r = power * growth + power;
    return __builtin_expect(all_true(easy), 1) ? r : where(easy, r, library_exp(x));
}
INLINE lanes lanes_tanh(lanes x) /* = e / (e + 2) with e = exp(2 |x|) - 1; from 20 on it is 1 to the last place */
{
    const lanes size = lanes_fabs(x);
    lanes power;
    const lanes growth = grown(2.0 * where(COMPARED(size, <, all_lanes(20.0)), size, all_lanes(20.0)), &power);
    const lanes e = power * growth + (power - 1.0), r = e / (e + 2.0);
    const lanes signed_r = as_lanes(as_bits(r) | sign_bit(x));
    return where(COMPARED(x, ==, x), signed_r, x);
}
