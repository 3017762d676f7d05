#pragma once

#include <span>
#include <vector>

namespace tubetrack::bench {

/// n of y = c · xⁿ, by least squares in the logarithms. Pairs in which one is not above 0 say nothing of it and are
/// left out; NaN where fewer than two different x are left.
double power_exponent(std::span<const double> x, std::span<const double> y);

/// The 99th percentile; NaN of fewer than 1000 values, of which it would be no more than the worst few.
double p99(const std::vector<double>& values);

/// Place of the i-th frame shown when `count` frames are played forth and back without showing an end twice:
/// 0, 1, …, count − 1, count − 2, …, 1, 0, 1, …
int there_and_back(int i, int count);

/// Where something is at the k-th of `count` frames that swings forth and back when these are played so: 0 at the
/// first, 1 at the last, at rest at both.
double swing(int k, int count);

}  // namespace tubetrack::bench
