#include "tubetrack/tracker/stations.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

#include "shape_sums.hpp"
#include "station_pixels.hpp"
#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

constexpr double kSeenRadius_m = 0.03;

/// The noisy view of a straight tube with readings that are missing, another tube's, nearer and farther.
HeightMap noisy_map(const Vector3d& middle, const Vector3d& axis) {
  HeightMap map = cylinder_map(kVga, middle, axis, 0.1, kSeenRadius_m);
  std::mt19937_64 random(4);
  std::normal_distribution<float> gauss(0.0F, 0.003F);
  for (float& depth_m : map.depth_m) {
    if (depth_m <= 0.0F) continue;
    depth_m += gauss(random);
    const auto kind = random() % 40;
    depth_m = kind == 0   ? 0.0F
              : kind == 1 ? -depth_m
              : kind == 2 ? 0.9F * depth_m
              : kind == 3 ? 1.1F * depth_m
                          : depth_m;
  }
  return map;
}

/// `take_pixels`, pixel by pixel.
std::vector<StationPixels> taken_slowly(const HeightMap& map, const TubeModel& model, const PredictedPixels& pixels,
                                        double per_span, std::size_t count) {
  std::vector<StationPixels> stations(count);
  for (const PredictedPixel& pixel : pixels) {
    if (pixel.cos_incidence < kCos75) continue;
    StationPixels& station = stations[std::min(static_cast<std::size_t>(pixel.t * per_span), count - 1)];
    const float measured = map.depth_m[pixel.cell];
    const double off = measured - pixel.depth_m;
    const PixelKind kind = measured < 0.0F                              ? PixelKind::anothers
                           : measured == 0.0F                           ? PixelKind::no_reading
                           : std::abs(off) <= agreement_m(model, pixel) ? PixelKind::agrees
                           : off < 0.0                                  ? PixelKind::before
                                                                        : PixelKind::behind;
    ++station.count[static_cast<std::size_t>(kind)];
    if (measured > 0.0F) add_to_shape(model, pixel, off, station.shape);
  }
  return stations;
}

TEST(Stations, HoldBitForBitWhatPixelByPixelGives) {
  const Vector3d middle(0.01, -0.02, 0.8);
  for (const Vector3d& along : {Vector3d(1.0, 0.3, 0.15), Vector3d(0.1, 1.0, -0.2)}) {
    const Vector3d axis = along.normalized();
    const HeightMap map = noisy_map(middle, axis);
    const TubeModel model = straight_model(middle, axis, 0.1, 1.01 * kSeenRadius_m);
    for (const int stride : {1, 3}) {
      const PredictedPixels pixels = predict_pixels(map, NoiseModel{}, model, stride);
      const std::size_t count = 57;
      const double per_span = static_cast<double>(count) / model.spline.spans();
      std::vector<StationPixels> stations(count);
      take_pixels(map.depth_m.data(), model.radius_m, pixels, per_span, stations);
      const auto slowly = taken_slowly(map, model, pixels, per_span, count);
      int seen = 0;
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(stations[i].count, slowly[i].count) << i;
        EXPECT_EQ(std::memcmp(&stations[i].shape, &slowly[i].shape, sizeof(ShapeSums)), 0) << i;
        for (const int pixels_of_kind : slowly[i].count) seen += pixels_of_kind;
      }
      EXPECT_GT(seen, 500);
    }
  }
}

}  // namespace
}  // namespace tubetrack
