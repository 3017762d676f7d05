#include "tubetrack/tracker/stations.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "shape_sums.hpp"
#include "station_pixels.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

double arc_length_m(const Spline& spline, double t_begin, double t_end) {
  constexpr int kSteps = 200;
  const RecycledVector<SpanPolynomial> curve = polynomials_of(spline);
  const auto point_m = [&](double t) -> Eigen::Vector3d {
    const double clamped = std::clamp(t, 0.0, static_cast<double>(curve.size()));
    const std::size_t span = std::min(static_cast<std::size_t>(clamped), curve.size() - 1);
    const double s = clamped - static_cast<double>(span);
    const auto& [c0, c1, c2, c3] = curve[span];
    return c0 + s * (c1 + s * (c2 + s * c3));
  };
  double length = 0.0;
  Eigen::Vector3d from = point_m(t_begin);
  for (int i = 1; i <= kSteps; ++i) {
    const Eigen::Vector3d to = point_m(t_begin + (t_end - t_begin) * i / kSteps);
    length += (to - from).norm();
    from = to;
  }
  return length;
}

double station_length_m(const HeightMap& map, const TubeModel& model) {
  const Eigen::Vector3d middle = point_at(model.spline, 0.5 * model.spline.spans());
  return std::max(0.002, 2.0 * middle.z() / map.intrinsics.fx_px);
}

RecycledVector<Station> stations_of(const HeightMap& map, const TubeModel& model, const PredictedPixels& predicted,
                                    double length_m) {
  const double spans = model.spline.spans();
  const int count = std::max(1, static_cast<int>(std::ceil(arc_length_m(model.spline, 0.0, spans) / length_m)));
  RecycledVector<Station> stations(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) stations[static_cast<std::size_t>(i)].t = (i + 0.5) * spans / count;
  RecycledVector<StationPixels> pixels(stations.size());
  take_pixels(map.depth_m.data(), model.radius_m, predicted, count / spans, pixels);
  const int around = std::max(1, static_cast<int>(std::lround(0.25 * model.radius_m / length_m)));
  for (int i = 0; i < count; ++i) {
    ShapeSums sum;
    for (int j = std::max(0, i - around); j <= std::min(count - 1, i + around); ++j)
      sum += pixels[static_cast<std::size_t>(j)].shape;
    const StationPixels& own = pixels[static_cast<std::size_t>(i)];
    Station& station = stations[static_cast<std::size_t>(i)];
    station.expected = std::accumulate(own.count.begin(), own.count.end(), 0);
    station.agree = own.of(PixelKind::agrees);
    station.anothers = own.of(PixelKind::anothers);  // taken out, see hide.hpp
    station.before = own.of(PixelKind::before) + station.anothers;
    station.behind = own.of(PixelKind::behind);
    station.flatness = sum.flatness();
  }
  return stations;
}

Extent seen_extent(const RecycledVector<Station>& stations, double station_m, double max_gap_m) {
  const double half = stations.size() > 1 ? 0.5 * (stations[1].t - stations[0].t)
                      : stations.empty()  ? 0.0
                                          : stations[0].t;
  Extent best;
  int best_seen = 0;
  std::size_t i = 0;
  while (i < stations.size()) {
    if (!stations[i].seen()) {
      ++i;
      continue;
    }
    const std::size_t first = i;
    std::size_t last = i;
    int seen = 1;
    for (++i; i < stations.size() && static_cast<double>(i - last - 1) * station_m <= max_gap_m; ++i) {
      if (stations[i].refuted() && static_cast<double>(i - last) > 2.0) break;
      if (!stations[i].seen()) continue;
      last = i;
      ++seen;
    }
    i = std::max(i, last + 1);
    if (seen > best_seen) {
      best_seen = seen;
      best = {stations[first].t - half, stations[last].t + half};
    }
  }
  return best;
}

}  // namespace tubetrack
