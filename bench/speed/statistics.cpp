#include "statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "figures.hpp"

namespace tubetrack::bench {

double power_exponent(std::span<const double> x, std::span<const double> y) {
  double count = 0.0;
  double sum_x = 0.0;
  double sum_y = 0.0;
  double sum_xx = 0.0;
  double sum_xy = 0.0;
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!(x[i] > 0.0) || !(y[i] > 0.0)) continue;
    const double log_x = std::log(x[i]);
    const double log_y = std::log(y[i]);
    count += 1.0;
    sum_x += log_x;
    sum_y += log_y;
    sum_xx += log_x * log_x;
    sum_xy += log_x * log_y;
  }
  const double spread = count * sum_xx - sum_x * sum_x;
  if (spread < 1e-9) return std::numeric_limits<double>::quiet_NaN();
  return (count * sum_xy - sum_x * sum_y) / spread;
}

double p99(const std::vector<double>& values) {
  return values.size() < 1000 ? std::numeric_limits<double>::quiet_NaN() : quantile(values, 0.99);
}

int there_and_back(int i, int count) {
  if (count < 2) return 0;
  const int round = i % (2 * count - 2);
  return round < count ? round : 2 * count - 2 - round;
}

double swing(int k, int count) {
  return count < 2 ? 0.0 : 0.5 - 0.5 * std::cos(std::numbers::pi * k / (count - 1));
}

}  // namespace tubetrack::bench
