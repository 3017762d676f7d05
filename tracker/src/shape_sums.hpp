#pragma once

#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// Sums for the line off = a + flatness · R · cos φ by least squares, φ the angle around the section.
struct ShapeSums {
  double n = 0.0, c = 0.0, cc = 0.0, r = 0.0, cr = 0.0;

  void add(double cos_angle, double off, double weight) {
    n += weight;
    c += weight * cos_angle;
    cc += weight * cos_angle * cos_angle;
    r += weight * off;
    cr += weight * cos_angle * off;
  }
  ShapeSums& operator+=(const ShapeSums& other) {
    n += other.n;
    c += other.c;
    cc += other.cc;
    r += other.r;
    cr += other.cr;
    return *this;
  }
  double spread() const { return cc - c * c / std::max(n, 1e-12); }
  double slope() const { return spread() > 1e-9 ? (cr - c * r / n) / spread() : 0.0; }
  double slope_sigma() const { return spread() > 1e-9 ? 1.0 / std::sqrt(spread()) : 1e3; }
  /// In radii when the offs were; 0 where it is less than twice its σ.
  double flatness() const { return std::abs(slope()) > 2.0 * slope_sigma() ? slope() : 0.0; }
};

/// How far a reading may stray and still be this tube's.
inline double agreement_m(const TubeModel& model, float sigma_m) {
  return 3.5 * sigma_m + 0.05 * model.radius_m;
}
inline double agreement_m(const TubeModel& model, const PredictedPixel& pixel) {
  return agreement_m(model, pixel.sigma_m);
}

/// A reading of the tube or of what may stand in its place.
inline void add_to_shape(const TubeModel& model, const PredictedPixel& pixel, double off_m, ShapeSums& shape) {
  if (std::abs(off_m) > 0.6 * model.radius_m + 4.0 * pixel.sigma_m) return;
  const float cos_angle = std::sqrt(std::max(0.0F, 1.0F - pixel.lateral * pixel.lateral));
  const float radii = pixel.across / static_cast<float>(model.radius_m);
  const float sigma = pixel.sigma_m * radii;
  shape.add(cos_angle, off_m * radii, 1.0F / (sigma * sigma));
}

double arc_length_m(const Spline& spline, double t_begin, double t_end);

}  // namespace tubetrack
