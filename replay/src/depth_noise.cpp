#include "tubetrack/replay/depth_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "measure.hpp"

namespace tubetrack {

namespace {

constexpr double kDropoutIncidence_rad = 80.0 * std::numbers::pi / 180.0;
constexpr double kEdgeDropout = 0.5;
constexpr double kEdgeMixed = 0.3;

/// What a random number is for: each use of a pixel has its own, so switching one part off leaves the others as are.
enum class Draw : std::uint64_t { axial, jitter, dropout, mixed, mixture };

/// splitmix64's output function. The standard library's distributions differ between libraries; this does not.
std::uint64_t scrambled(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/// Uniform in (0, 1), 53 bits.
double uniform(std::uint64_t frame_seed, std::size_t pixel, Draw draw, std::uint64_t half = 0) {
  const std::uint64_t which = (static_cast<std::uint64_t>(pixel) << 8) | (static_cast<std::uint64_t>(draw) << 1) | half;
  const std::uint64_t bits = scrambled(frame_seed ^ scrambled(which));
  return (static_cast<double>(bits >> 11) + 0.5) * 0x1.0p-53;
}

/// Two independent standard normals (Box–Muller); below 8.7 in size since the uniforms have 53 bits.
std::array<double, 2> two_normals(std::uint64_t frame_seed, std::size_t pixel, Draw draw) {
  const double size = std::sqrt(-2.0 * std::log(uniform(frame_seed, pixel, draw, 0)));
  const double angle = 2.0 * std::numbers::pi * uniform(frame_seed, pixel, draw, 1);
  return {size * std::cos(angle), size * std::sin(angle)};
}

/// A pixel is at a depth edge when it and one of its four neighbours differ by more than a surface seen at 80° would
/// (steeper surfaces give no return anyway). Gives that neighbour's depth (infinite: it sees nothing), the largest
/// jump where there are several; 0 when there is no edge.
double depth_across_edge(const ExactPixels& exact, int u, int v, double step_at_80) {
  const auto at = [&](int uu, int vv) {
    return exact
        .depth_m[static_cast<std::size_t>(vv) * static_cast<std::size_t>(exact.width) + static_cast<std::size_t>(uu)];
  };
  const double own = at(u, v);
  double across = 0.0;
  double largest = 0.0;
  const auto look = [&](int uu, int vv) {
    if (uu < 0 || vv < 0 || uu >= exact.width || vv >= exact.height) return;
    const double other = at(uu, vv);
    if (std::isinf(own) && std::isinf(other)) return;
    const double jump = std::abs(other - own);
    if (jump > step_at_80 * std::min(own, other) && jump > largest) {
      largest = jump;
      across = other;
    }
  };
  look(u - 1, v);
  look(u + 1, v);
  look(u, v - 1);
  look(u, v + 1);
  return across;
}

double measured_depth(const DepthNoise& noise, double depth_m, double incidence_rad, std::uint64_t seed,
                      std::size_t pixel) {
  double z = depth_m;
  if (noise.axial) {
    NoiseModel unrounded = noise.sensor;
    unrounded.disparity_step_px = 0.0;
    unrounded.depth_step_m = 0.0;
    z += axial_sigma_m(unrounded, depth_m, incidence_rad) * two_normals(seed, pixel, Draw::axial)[0];
  }
  if (noise.quantisation && noise.sensor.disparity_step_px > 0.0 && z > 0.0) {
    const double steps = std::round(noise.sensor.baseline_focal_m_px / z / noise.sensor.disparity_step_px);
    z = steps > 0.0 ? noise.sensor.baseline_focal_m_px / (steps * noise.sensor.disparity_step_px) : 0.0;
  }
  return std::max(z, 0.0);
}

}  // namespace

DepthNoise DepthNoise::none() {
  DepthNoise off;
  off.axial = off.jitter = off.quantisation = off.dropout = off.mixed = off.shadow = false;
  off.metres_per_unit = 0.0001;
  return off;
}

std::uint64_t seed_of_frame(std::uint64_t scene_seed, int frame) {
  return scrambled(scrambled(scene_seed) + static_cast<std::uint64_t>(frame));
}

PixelJitter pixel_jitter(const DepthNoise& noise, std::uint64_t frame_seed, std::size_t pixel) {
  const std::array<double, 2> normals = two_normals(frame_seed, pixel, Draw::jitter);
  return {noise.sensor.lateral_px * normals[0], noise.sensor.lateral_px * normals[1]};
}

MeasuredPixels measure(const ExactPixels& exact, const DepthNoise& noise, std::uint64_t frame_seed) {
  MeasuredPixels out;
  out.depth_m.assign(exact.depth_m.size(), 0.0);
  out.mixed.assign(exact.depth_m.size(), 0);
  // Seen at 80°, depth changes by z / f · tan 80° a pixel; f is the sensor's 570 px whatever the scene's camera.
  const double step_at_80 = std::tan(kDropoutIncidence_rad) * 0.075 / noise.sensor.baseline_focal_m_px;
  for (std::size_t i = 0; i < exact.depth_m.size(); ++i) {
    const double seen = exact.seen_depth_m[i];
    if (std::isinf(seen)) continue;
    double z = measured_depth(noise, seen, exact.incidence_rad[i], frame_seed, i);
    const auto width = static_cast<std::size_t>(exact.width);
    const double across = noise.dropout || noise.mixed ? depth_across_edge(exact, static_cast<int>(i % width),
                                                                           static_cast<int>(i / width), step_at_80)
                                                       : 0.0;
    if (noise.dropout) {
      if (exact.incidence_rad[i] > kDropoutIncidence_rad) continue;
      if (across > 0.0 && uniform(frame_seed, i, Draw::dropout) < kEdgeDropout) continue;
    }
    const bool two_depths = across > 0.0 && std::isfinite(across) && std::isfinite(exact.depth_m[i]);
    if (noise.mixed && two_depths && uniform(frame_seed, i, Draw::mixed) < kEdgeMixed) {
      z = exact.depth_m[i] + uniform(frame_seed, i, Draw::mixture) * (across - exact.depth_m[i]);
      out.mixed[i] = 1;
    }
    if (!exact.shadow.empty() && exact.shadow[i] != 0) continue;
    out.depth_m[i] = z;
  }
  return out;
}

}  // namespace tubetrack
