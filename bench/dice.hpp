#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string_view>

namespace tubetrack::bench {

/// Random numbers that are the same with every standard library: its engines are specified, its distributions are not.
class Dice {
 public:
  /// Rows don't share numbers: a new row leaves the others' scenes as they were.
  Dice(std::string_view row, std::uint64_t seed) {
    std::uint64_t hash = 0xCBF29CE484222325ULL;  // FNV-1a
    for (const char c : row) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
    engine_.seed(hash ^ (seed * 0x9E3779B97F4A7C15ULL));
  }

  double uniform(double from, double to) {
    return from + (to - from) * (static_cast<double>(engine_() >> 11) * 0x1.0p-53);
  }
  /// 0 … count − 1.
  int pick(int count) { return static_cast<int>(uniform(0.0, count)); }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }

  /// Unit, even over the sphere.
  Eigen::Vector3d direction() {
    const double z = uniform(-1.0, 1.0);
    const double turn = uniform(0.0, 2.0 * std::numbers::pi);
    const double across = std::sqrt(1.0 - z * z);
    return {across * std::cos(turn), across * std::sin(turn), z};
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace tubetrack::bench
