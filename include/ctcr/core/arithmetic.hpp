#pragma once
// The arithmetic that all headers rely on: that of IEEE 754, as written.
//
// Options that let a compiler rearrange sums make `(x + c) - c` of sincos() to `x`: every angle would be rounded to a quarter
// turn, and positions would be wrong with the status ok. Options that assume finite numbers remove the tests for NaN.
// -ffp-contract=fast, which only spares roundings, is welcome. (Clang tells nothing of -fassociative-math alone.)

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
#error \
    "ctcr: compile without -ffast-math, -Ofast, -ffinite-math-only, -fassociative-math (MSVC: /fp:fast): angles would be wrong, and NaN unseen"
#endif
