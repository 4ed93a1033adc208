/* Numbers of a program and the functions of its expressions, one at a time and side by side.

   `simd.h` defines every function for vectors of one width; all widths do the same operations on every number, so
   that a number does not depend on how many were computed with it. Nothing may contract a * b + c behind the
   compiler's back (-ffp-contract=off): CK_FMA says where it is meant, and is one operation in all widths or in none. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define CK_INLINE static inline __attribute__((always_inline, unused))
#define CK_JOIN_(a, b) a##b
#define CK_JOIN(a, b) CK_JOIN_(a, b)

#if defined(__FMA__) || defined(__AVX512F__) || defined(__aarch64__)
#define CK_HAS_FMA 1
#else
#define CK_HAS_FMA 0
#endif

#ifndef __has_builtin
#define __has_builtin(name) 0
#endif
#if !defined(__clang__) && __has_builtin(__builtin_ia32_vfmaddpd512_mask) && __has_builtin(__builtin_ia32_vfmaddpd256)
#define CK_GCC_VECTORS 1
#else
#define CK_GCC_VECTORS 0
#endif

/* Polynomials: (exp(r) - 1 - r) / r^2 on |r| <= ln(2) / 2, interpolated at Chebyshev nodes, which leaves a relative
   error of exp of 1.6e-17 in double and 1.0e-8 in single precision. ln(2) is split into a part with zeros at its end,
   whose product with an exponent is exact, and the rest. Adding 1.5 * 2^52 rounds to a whole number, which then stands
   in the last bits. */
#ifdef CK_SINGLE
typedef float real;
typedef int32_t whole;
#define CK_UNSIGNED uint32_t
#define CK_LIBM(name) CK_JOIN(name, f)
#define CK_FMA_BUILTIN __builtin_fmaf
#define CK_VECTOR_FMA __builtin_ia32_vfmaddps
#define CK_SQRT_BUILTIN __builtin_sqrtf
#define CK_FLOOR_BUILTIN __builtin_floorf
#define CK_SIZE 4
#define CK_MANTISSA 23
#define CK_ROUND 12582912.0f
#define CK_LN2_HIGH 0.693145751953125f
#define CK_LN2_LOW 1.4286068203094173e-06f
#define CK_EXP_END 150.0f   /* beyond, exp is infinite or 0 in any case */
#define CK_SAFE_END 87.0f   /* up to here exp and its reciprocal are normal numbers */
#define CK_INFINITE 88.9f   /* 2^128, and so infinite by its bits */
#define CK_SIGN_BIT INT32_MIN
#else
typedef double real;
typedef int64_t whole;
#define CK_UNSIGNED uint64_t
#define CK_LIBM(name) name
#define CK_FMA_BUILTIN __builtin_fma
#define CK_VECTOR_FMA __builtin_ia32_vfmaddpd
#define CK_SQRT_BUILTIN __builtin_sqrt
#define CK_FLOOR_BUILTIN __builtin_floor
#define CK_SIZE 8
#define CK_MANTISSA 52
#define CK_ROUND 6755399441055744.0
#define CK_LN2_HIGH 0.6931471805598903
#define CK_LN2_LOW 5.497923018708371e-14
#define CK_EXP_END 1000.0
#define CK_SAFE_END 708.0
#define CK_INFINITE 709.9   /* 2^1024 */
#define CK_SIGN_BIT INT64_MIN
#endif
#define CK_LOG2_E ((real)1.4426950408889634)

CK_INLINE int ck_is_finite(real x)
{
    return x - x == 0;
}

/* The place in a ring that was written some steps before this one. */
CK_INLINE int64_t ck_ago(int64_t place, int64_t steps, int64_t depth)
{
    int64_t before = place - steps;
    return before < 0 ? before + depth : before >= depth ? before - depth : before;
}

#define N 1
#include "simd.h"
#undef N
#define N 2
#include "simd.h"
#undef N
#define N 4
#include "simd.h"
#undef N
#define N 8
#include "simd.h"
#undef N
#ifdef CK_SINGLE
#define N 16
#include "simd.h"
#undef N
#endif
