/* The functions of expressions for N numbers side by side; included by `arithmetic.h` once for every N.

   A loop over lanes becomes one instruction where the machine has it: compilers find these without intrinsics. */

#define CK(name) CK_JOIN(name##_, N)
#if N * CK_SIZE >= 16 && (defined(__AVX512F__) || (defined(__AVX__) && N * CK_SIZE <= 32))
#ifdef CK_SINGLE /* compilers take two instructions for what is one */
#define CK_ASSEMBLY "ps"
#else
#define CK_ASSEMBLY "pd"
#endif
#endif
/* The loop below is found to be one instruction as well, but finding it takes long. */
#if N > 1 && __has_builtin(__builtin_elementwise_fma)
#define CK_FMA(a, b, c) __builtin_elementwise_fma(a, b, c)
#elif N > 1 && CK_HAS_FMA && CK_GCC_VECTORS && N * CK_SIZE == 64 && defined(__AVX512F__)
#define CK_FMA(a, b, c) CK_JOIN(CK_VECTOR_FMA, 512_mask)(a, b, c, -1, 4)
#elif N > 1 && CK_HAS_FMA && CK_GCC_VECTORS && N * CK_SIZE == 32
#define CK_FMA(a, b, c) CK_JOIN(CK_VECTOR_FMA, 256)(a, b, c)
#elif N > 1 && CK_HAS_FMA && CK_GCC_VECTORS && N * CK_SIZE == 16
#define CK_FMA(a, b, c) CK_VECTOR_FMA(a, b, c)
#endif
#define EACH_LANE for (int lane = 0; lane < N; lane++)

#if N == 1
typedef real v_1;
typedef whole w_1;
typedef CK_UNSIGNED n_1;
#define AT(x) (x)
#else
typedef real CK(v) __attribute__((vector_size(N * sizeof(real))));
typedef whole CK(w) __attribute__((vector_size(N * sizeof(real))));
typedef CK_UNSIGNED CK(n) __attribute__((vector_size(N * sizeof(real)))); /* may be shifted beyond its end */
typedef real CK(u) __attribute__((vector_size(N * sizeof(real)), aligned(sizeof(real)), may_alias)); /* in memory */
#define AT(x) (x)[lane]
#endif

CK_INLINE CK(v) CK(all)(real x)
{
#if N == 1
    return x;
#else
    return x - (CK(v)){0}; /* compilers know this, unlike a loop, as one instruction */
#endif
}

CK_INLINE CK(w) CK(bits)(CK(v) x)
{
    CK(w) y;
    memcpy(&y, &x, sizeof y);
    return y;
}

CK_INLINE CK(v) CK(number)(CK(w) x)
{
    CK(v) y;
    memcpy(&y, &x, sizeof y);
    return y;
}

CK_INLINE CK(v) CK(load)(const real *from)
{
#if N == 1
    return *from;
#else
    return *(const CK(u) *)from;
#endif
}

CK_INLINE void CK(store)(real *to, CK(v) x)
{
#if N == 1
    *to = x;
#else
    *(CK(u) *)to = x;
#endif
}

/* The sum of the lanes: not finite if one of them is not. */
CK_INLINE real CK(total)(CK(v) x)
{
    real sum = 0;
    EACH_LANE sum += AT(x);
    return sum;
}

CK_INLINE CK(v) CK(pick)(const real *from, const int32_t *places)
{
    CK(v) y;
    EACH_LANE AT(y) = from[places[lane]];
    return y;
}

CK_INLINE CK(v) CK(fma)(CK(v) a, CK(v) b, CK(v) c)
{
#if !CK_HAS_FMA
    return a * b + c;
#elif defined(CK_FMA)
    return CK_FMA(a, b, c);
#else
    CK(v) y;
    EACH_LANE AT(y) = CK_FMA_BUILTIN(AT(a), AT(b), AT(c));
    return y;
#endif
}

/* Which of two, by a comparison: of vectors it gives ones or zeros in all bits. */
CK_INLINE CK(v) CK(chosen)(CK(w) mask, CK(v) then, CK(v) otherwise)
{
#if N == 1
    return mask ? then : otherwise;
#else
    return CK(number)((CK(bits)(then) & mask) | (CK(bits)(otherwise) & ~mask));
#endif
}

/* a < b ? a : b, and a > b ? a : b; so the second operand where one is not a number. */
CK_INLINE CK(v) CK(lower)(CK(v) a, CK(v) b)
{
#ifdef CK_ASSEMBLY
    CK(v) y;
    __asm__("vmin" CK_ASSEMBLY " %2, %1, %0" : "=v"(y) : "v"(a), "v"(b));
    return y;
#else
    return CK(chosen)(a < b, a, b);
#endif
}

CK_INLINE CK(v) CK(higher)(CK(v) a, CK(v) b)
{
#ifdef CK_ASSEMBLY
    CK(v) y;
    __asm__("vmax" CK_ASSEMBLY " %2, %1, %0" : "=v"(y) : "v"(a), "v"(b));
    return y;
#else
    return CK(chosen)(a > b, a, b);
#endif
}

#define COMPARISON(name, sign) \
    CK_INLINE CK(v) CK(name)(CK(v) a, CK(v) b) \
    { \
        return CK(chosen)(a sign b, CK(all)(1), CK(all)(0)); \
    }
COMPARISON(less, <)
COMPARISON(less_equal, <=)
COMPARISON(greater, >)
COMPARISON(greater_equal, >=)
#undef COMPARISON

CK_INLINE CK(v) CK(where)(CK(v) condition, CK(v) then, CK(v) otherwise)
{
    return CK(chosen)(condition == CK(all)(0), otherwise, then);
}

/* `x` where it is not a number, else `y`. */
CK_INLINE CK(v) CK(unless_nan)(CK(v) x, CK(v) y)
{
    return CK(chosen)(x == x, y, x);
}

CK_INLINE CK(v) CK(min)(CK(v) a, CK(v) b)
{
    return CK(unless_nan)(a, CK(lower)(a, b));
}

CK_INLINE CK(v) CK(max)(CK(v) a, CK(v) b)
{
    return CK(unless_nan)(a, CK(higher)(a, b));
}

CK_INLINE CK(v) CK(clip)(CK(v) x, CK(v) low, CK(v) high)
{
    return CK(min)(CK(max)(x, low), high);
}

CK_INLINE CK(v) CK(abs)(CK(v) x)
{
    return CK(number)(CK(bits)(x) & ~CK_SIGN_BIT);
}

CK_INLINE CK(v) CK(heaviside)(CK(v) x)
{
    return CK(unless_nan)(x, CK(greater_equal)(x, CK(all)(0)));
}

CK_INLINE CK(v) CK(sign)(CK(v) x)
{
    CK(v) zero = CK(all)(0);
    return CK(unless_nan)(x, CK(greater)(x, zero) - CK(less)(x, zero));
}

#define EACH(name, function) \
    CK_INLINE CK(v) CK(name)(CK(v) x) \
    { \
        CK(v) y; \
        EACH_LANE AT(y) = function(AT(x)); \
        return y; \
    }
EACH(sqrt, CK_SQRT_BUILTIN)
EACH(floor, CK_FLOOR_BUILTIN)
EACH(log, CK_LIBM(log))
EACH(log1p, CK_LIBM(log1p))
EACH(sin, CK_LIBM(sin))
EACH(cos, CK_LIBM(cos))
#undef EACH

#define EACH_PAIR(name) \
    CK_INLINE CK(v) CK(name)(CK(v) a, CK(v) b) \
    { \
        CK(v) y; \
        EACH_LANE AT(y) = CK_LIBM(name)(AT(a), AT(b)); \
        return y; \
    }
EACH_PAIR(pow)
EACH_PAIR(atan2)
EACH_PAIR(hypot)
#undef EACH_PAIR

/* Whole powers, by the fewest products. */
#define POWER(n, y) \
    CK_INLINE CK(v) CK(power##n)(CK(v) x) \
    { \
        return y; \
    }
POWER(1, x)
POWER(2, x * x)
POWER(3, x * x * x)
POWER(4, CK(power2)(x * x))
POWER(5, CK(power4)(x) * x)
POWER(6, CK(power3)(x * x))
POWER(7, CK(power6)(x) * x)
POWER(8, CK(power4)(x * x))
#undef POWER

/* x = k ln(2) + r with a whole k, as a number and in the last bits of another one. */
CK_INLINE CK(v) CK(reduce)(CK(v) x, CK(v) *k, CK(w) *k_bits)
{
    CK(v) shifted = CK(fma)(x, CK(all)(CK_LOG2_E), CK(all)(CK_ROUND));
    CK(v) r;
    *k = shifted - CK(all)(CK_ROUND);
    *k_bits = CK(bits)(shifted);
    r = CK(fma)(-*k, CK(all)(CK_LN2_HIGH), x);
    return CK(fma)(-*k, CK(all)(CK_LN2_LOW), r);
}

/* (exp(r) - 1 - r) / r^2; the terms in pairs, since they need not wait for each other. */
CK_INLINE CK(v) CK(polynomial)(CK(v) r, CK(v) r2)
{
#define C(x) CK(all)((real)(x))
    CK(v) r4 = r2 * r2;
#ifdef CK_SINGLE
    CK(v) a = CK(fma)(C(0.16666576), r, C(0.5));
    CK(v) b = CK(fma)(C(0.008363179), r, C(0.041666556));
    return CK(fma)(r4, C(0.0013926184), CK(fma)(b, r2, a));
#else
    CK(v) a = CK(fma)(C(0.16666666666666669), r, C(0.5000000000000001));
    CK(v) b = CK(fma)(C(0.008333333333330062), r, C(0.04166666666662413));
    CK(v) c = CK(fma)(C(0.00019841269863053618), r, C(0.0013888888917213717));
    CK(v) d = CK(fma)(C(2.7557268459997064e-06), r, C(2.4801521295954376e-05));
    CK(v) e = CK(fma)(C(2.510038549551032e-08), r, C(2.7620088445409746e-07));
    CK(v) ab = CK(fma)(b, r2, a);
    CK(v) cd = CK(fma)(d, r2, c);
    return CK(fma)(r4, CK(fma)(r4, e, cd), ab);
#endif
#undef C
}

/* 2^k for |k| below the largest exponent; k in the last bits of a number. */
CK_INLINE CK(v) CK(power_of_two)(CK(w) k_bits)
{
    return CK(number)((CK(w))(((CK(n))k_bits << CK_MANTISSA) + (CK(n))CK(bits)(CK(all)(1))));
}

/* k as a sum of two that each fit into an exponent, whatever exp(x) does. */
CK_INLINE void CK(halve)(CK(v) k, CK(w) k_bits, CK(w) *first, CK(w) *second)
{
    CK(v) shifted = CK(fma)(k, CK(all)((real)0.5), CK(all)(CK_ROUND));
    *first = CK(bits)(shifted);
    *second = k_bits - *first;
}

CK_INLINE CK(v) CK(exp)(CK(v) x)
{
    CK(v) k, r, r2, p;
    CK(w) k_bits, first, second;
    x = CK(higher)(CK(all)(-CK_EXP_END), CK(lower)(CK(all)(CK_EXP_END), x));
    r = CK(reduce)(x, &k, &k_bits);
    r2 = r * r;
    p = CK(all)(1) + CK(fma)(CK(polynomial)(r, r2), r2, r);
    CK(halve)(k, k_bits, &first, &second);
    return p * CK(power_of_two)(first) * CK(power_of_two)(second);
}

CK_INLINE CK(v) CK(expm1)(CK(v) x)
{
    CK(v) k, r, r2, p, scale;
    CK(w) k_bits, first, second;
    x = CK(higher)(CK(all)(-CK_EXP_END), CK(lower)(CK(all)(CK_EXP_END), x));
    r = CK(reduce)(x, &k, &k_bits);
    r2 = r * r;
    p = CK(fma)(CK(polynomial)(r, r2), r2, r);
    CK(halve)(k, k_bits, &first, &second);
    scale = CK(power_of_two)(first);
    return CK(fma)(scale, p, scale - CK(power_of_two)(-second)) * CK(power_of_two)(second);
}

/* (exp(x) - 1) / x, 1 at 0; where exp is infinite, so is this, whatever the divisor. */
CK_INLINE CK(v) CK(exprel)(CK(v) x)
{
    return CK(where)(x, CK(expm1)(x) / CK(where)(x, CK(lower)(CK(all)(CK_EXP_END), x), CK(all)(1)), CK(all)(1));
}

/* (2^f - 1) / f on |f| <= 1/2; 2^f is off by 6e-16 in double and 9e-9 in single precision, beside the rounding. */
CK_INLINE CK(v) CK(polynomial_of_two)(CK(v) f)
{
#define C(x) CK(all)((real)(x))
    CK(v) f2 = f * f, f4 = f2 * f2;
#ifdef CK_SINGLE
    CK(v) a = CK(fma)(C(0.2402265), f, C(0.6931472));
    CK(v) b = CK(fma)(C(0.009618083), f, C(0.05550357));
    CK(v) c = CK(fma)(C(0.00015453163), f, C(0.0013390863));
    return CK(fma)(f4, c, CK(fma)(b, f2, a));
#else
    CK(v) a = CK(fma)(C(0.24022650695910075), f, C(0.6931471805599462));
    CK(v) b = CK(fma)(C(0.009618129107618665), f, C(0.05550410866465167));
    CK(v) c = CK(fma)(C(0.00015403530424776566), f, C(0.0013333558200794658));
    CK(v) d = CK(fma)(C(1.3215451633193289e-06), f, C(1.5252672924801992e-05));
    CK(v) e = CK(fma)(C(7.070977872941531e-09), f, C(1.0205905424907286e-07));
    CK(v) ab = CK(fma)(b, f2, a), cd = CK(fma)(d, f2, c);
    return CK(fma)(f4, CK(fma)(f4, e, cd), ab);
#endif
#undef C
}

/* 1 / (1 + 2^(-x / ln 2)). Bounds for x save a second scale: 1 from 708 on, and 0 below -709, as 1 / infinity. */
CK_INLINE CK(v) CK(sigmoid)(CK(v) x)
{
    CK(v) shifted, f, p;
    x = CK(higher)(CK(all)(-CK_INFINITE), CK(lower)(CK(all)(CK_SAFE_END), x));
    shifted = CK(fma)(x, CK(all)(-CK_LOG2_E), CK(all)(CK_ROUND));
    f = CK(fma)(x, CK(all)(-CK_LOG2_E), CK(all)(CK_ROUND) - shifted);
    p = CK(fma)(f, CK(polynomial_of_two)(f), CK(all)(1));
    return CK(all)(1) / CK(fma)(p, CK(power_of_two)(CK(bits)(shifted)), CK(all)(1));
}

/* With e = exp(-2 |x|) - 1: tanh |x| = -e / (e + 2). */
CK_INLINE CK(v) CK(tanh)(CK(v) x)
{
    CK(v) e = CK(expm1)(CK(all)(-2) * CK(abs)(x));
    CK(w) sign = CK(bits)(x) & CK_SIGN_BIT;
    return CK(number)(CK(bits)(-e / (e + CK(all)(2))) | sign);
}

#undef EACH_LANE
#undef AT
#undef CK_ASSEMBLY
#undef CK_FMA
#undef CK
