#include "line_ends.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// In spans.
constexpr double kTrim = 0.6;
constexpr double kLongRun = 2.4;  // enough to hold the line with an end left out
constexpr double kGap = 1.6;

/// How far along from an end of an extent a line is seen without a gap, in spans; the stations from that end on.
template <typename Stations>
double seen_at_once(double from, double to, Stations begin, Stations end) {
  double last = from;
  for (Stations at = begin; at != end; ++at) {
    const bool inside = std::min(from, to) <= at->t && at->t <= std::max(from, to);
    if (!inside || !at->seen()) continue;
    if (std::abs(at->t - last) > kGap) return std::abs(last - from);
    last = at->t;
  }
  return std::abs(to - from);
}

/// The last span of a line at an end, and so many beyond it.
Spline beyond_end(const Spline& line, bool front, int spans) {
  Spline end;
  const auto& q = line.control_m;
  if (front)
    end.control_m.assign(q.begin(), q.begin() + 4);
  else
    end.control_m.assign(q.end() - 4, q.end());
  for (int i = 0; i < spans; ++i) extend(end, front, !front);
  return end;
}

}  // namespace

void continue_from(Spline& spline, double t_begin, double t_end) {
  auto& q = spline.control_m;
  const auto at = [&](int i) -> Eigen::Vector3d& { return q[static_cast<std::size_t>(i)]; };
  const auto go_on = [&](int first, int step, int count) {
    for (int i = first; count > 0; i += step, --count) {
      const Eigen::Vector3d bend = ((at(i - step) - at(i - 2 * step)) - (at(i - 4 * step) - at(i - 5 * step))) / 3.0;
      at(i) = 2.0 * at(i - step) - at(i - 2 * step) + bend;
    }
  };
  // Control point i acts most at t = i − 1; replaced are those that do so half a span outside or more.
  const auto count = static_cast<int>(q.size());
  const int back = static_cast<int>(std::floor(t_end)) + 2;
  if (back >= 5 && back < count) go_on(back, 1, count - back);
  const int front = static_cast<int>(std::ceil(t_begin));
  if (front >= 0 && front + 5 < count) go_on(front, -1, front + 1);
}

TurnedEnds turned_to_camera(const Spline& spline, const Extent& extent) {
  constexpr double kTurned = 0.25;  // cosine
  constexpr double kInside = 2.0;   // spans, where a face has bent nothing yet
  const auto toward_camera = [&](double t, double outward) {
    const Eigen::Vector3d direction = outward * derivative_at(spline, t).normalized();
    return -direction.dot(point_at(spline, t).normalized());
  };
  return {toward_camera(extent.t_begin + kInside, -1.0) > kTurned,
          toward_camera(extent.t_end - kInside, 1.0) > kTurned};
}

bool is_well_seen(const RecycledVector<Station>& stations, const Extent& extent) {
  constexpr double kLeastRun = 4.0;
  int inside = 0, unseen = 0;
  for (const Station& station : stations) {
    if (station.t <= extent.t_begin || station.t >= extent.t_end) continue;
    ++inside;
    unseen += station.seen() ? 0 : 1;
  }
  return 10 * unseen <= inside &&
         seen_at_once(extent.t_begin, extent.t_end, stations.begin(), stations.end()) > kLeastRun &&
         seen_at_once(extent.t_end, extent.t_begin, stations.rbegin(), stations.rend()) > kLeastRun;
}

EndTrim trim_of(const Spline& spline, const RecycledVector<Station>& stations, const Extent& extent) {
  const double length = extent.t_end - extent.t_begin;
  const double trim = std::min(kTrim, 0.1 * length);
  const TurnedEnds faces = turned_to_camera(spline, extent);
  const auto at = [&](double run, bool face) {
    if (!face) return 0.0;
    return run >= kLongRun || length < kLongRun ? trim : std::min(trim, 0.5 * run);
  };
  return {at(seen_at_once(extent.t_begin, extent.t_end, stations.begin(), stations.end()), faces.at_begin),
          at(seen_at_once(extent.t_end, extent.t_begin, stations.rbegin(), stations.rend()), faces.at_end)};
}

bool may_go_on(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride) {
  constexpr int kSpans = 3;
  constexpr int kRefuted = 4;  // stations; with three in a row `seen_extent` ends
  if (!model.profile.offset_m.empty()) return true;
  thread_local PredictedPixels pixels;  // for its buffers
  for (const bool front : {false, true}) {
    const TubeModel end{beyond_end(model.spline, front, kSpans), model.radius_m};
    predict_pixels(map, noise, end, stride, pixels);
    int refuted = 0;
    for (const Station& station : stations_of(map, end, pixels, stride * station_length_m(map, end))) {
      const double beyond = front ? kSpans - station.t : station.t - 1.0;
      if (beyond > 0.8 && station.seen()) return true;
      refuted += beyond > 0.0 && station.refuted() ? 1 : 0;
    }
    if (refuted < kRefuted) return true;
  }
  return false;
}

}  // namespace tubetrack
