#pragma once

#include <cstddef>
#include <vector>

namespace tubetrack {

/// The quantiles of any number of values in bounded memory: all values up to `most`, then every second, every fourth …
/// of them, so that a run of months keeps as much as one of minutes. The same values give the same answer.
class Quantiles {
 public:
  Quantiles() = default;
  explicit Quantiles(std::size_t most) : most_(most) {}
  void add(float value);
  bool empty() const { return values_.empty(); }
  /// The smallest kept value with at least `part` of all kept at or below it; 0 for no values.
  double at(double part) const;

 private:
  std::size_t most_ = 16384;
  std::vector<float> values_;
  std::size_t every_ = 1;  ///< how many values one kept value stands for
  std::size_t skipped_ = 0;
};

}  // namespace tubetrack
