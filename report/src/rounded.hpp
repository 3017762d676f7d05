#pragma once

#include <cmath>

namespace tubetrack {

/// To a whole part of `per_unit`, without −0: lines stay short, and equal results give equal bytes.
inline double rounded(double value, double per_unit) {
  return std::round(value * per_unit) / per_unit + 0.0;
}
inline double micro(double value) {
  return rounded(value, 1e6);
}

}  // namespace tubetrack
