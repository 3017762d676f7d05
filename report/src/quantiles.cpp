#include "tubetrack/report/quantiles.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

void Quantiles::add(float value) {
  if (skipped_ + 1 < every_) {
    ++skipped_;
    return;
  }
  skipped_ = 0;
  values_.push_back(value);
  if (values_.size() < most_) return;
  for (std::size_t i = 0; i < most_ / 2; ++i) values_[i] = values_[2 * i];
  values_.resize(most_ / 2);
  every_ *= 2;
}

double Quantiles::at(double part) const {
  if (values_.empty()) return 0.0;
  std::vector<float> values = values_;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace tubetrack
