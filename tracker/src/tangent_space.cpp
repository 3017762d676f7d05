#include "tangent_space.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// A tangent is the slope of the nodes within this many radii to either side.
constexpr double kHalfWindowRadii = 0.75;
// Angles are not trusted farther than nodes this far off, in radii: the window rounds off where a bend begins.
constexpr double kLeastOffRadii = 0.02;
// What a further piece costs, in χ²: its numbers and its place.
constexpr double kStraightCost = 8.0;
constexpr double kArcCost = 18.0;
constexpr std::size_t kMaxSamples = 160;  // the cut costs their number squared
constexpr double kLeastRadius = 1.0;      // of a bend's centreline, in tube radii

/// Sums over a run of samples, enough for the best line through them.
struct Sums {
  double weight = 0.0, s = 0.0, ss = 0.0, yy = 0.0;
  Eigen::Vector2d y = Eigen::Vector2d::Zero(), sy = Eigen::Vector2d::Zero();

  Sums operator-(const Sums& other) const {
    return {weight - other.weight, s - other.s, ss - other.ss, yy - other.yy, y - other.y, sy - other.sy};
  }
};

/// A line in tangent space: angle = mean + slope · (along − middle).
struct TangentPiece {
  bool arc = false;
  std::size_t from = 0, to = 0;  ///< samples, half open
  double middle_m = 0.0;
  Eigen::Vector2d mean_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope_rad_m = Eigen::Vector2d::Zero();

  Eigen::Vector2d at(double along_m) const { return mean_rad + (along_m - middle_m) * slope_rad_m; }
};

RecycledVector<Sums> running_sums(const RecycledVector<TangentSpace::Sample>& samples) {
  RecycledVector<Sums> sums(1);
  for (const TangentSpace::Sample& sample : samples) {
    Sums next = sums.back();
    next.weight += sample.weight;
    next.s += sample.weight * sample.along_m;
    next.ss += sample.weight * sample.along_m * sample.along_m;
    next.y += sample.weight * sample.angle_rad;
    next.sy += sample.weight * sample.along_m * sample.angle_rad;
    next.yy += sample.weight * sample.angle_rad.squaredNorm();
    sums.push_back(next);
  }
  return sums;
}

double cost_of(const Sums& sums, bool arc) {
  const double about_mean = sums.yy - sums.y.squaredNorm() / sums.weight;
  if (!arc) return about_mean;
  const double spread = sums.ss - sums.s * sums.s / sums.weight;
  if (!(spread > 0.0)) return about_mean;
  return about_mean - (sums.sy - sums.s * sums.y / sums.weight).squaredNorm() / spread;
}

TangentPiece piece_of(const Sums& sums, bool arc, std::size_t from, std::size_t to) {
  TangentPiece piece{arc, from, to, sums.s / sums.weight, sums.y / sums.weight};
  const double spread = sums.ss - sums.s * piece.middle_m;
  if (arc && spread > 0.0) piece.slope_rad_m = (sums.sy - sums.s * piece.mean_rad) / spread;
  return piece;
}

/// Where the best cut up to here, ending in this kind of piece, has its last piece.
struct Best {
  double cost = std::numeric_limits<double>::infinity();
  std::size_t from = 0;
  bool arc_before = false;
};

/// The cheapest cut, by dynamic programming over where pieces end. Two straights never touch: between them is a bend.
RecycledVector<TangentPiece> cut(const RecycledVector<TangentSpace::Sample>& samples, double overcount, double thrift) {
  const RecycledVector<Sums> sums = running_sums(samples);
  const std::size_t count = samples.size();
  RecycledVector<std::array<Best, 2>> best(count + 1);
  best[0] = {Best{0.0}, Best{0.0}};
  for (std::size_t to = 1; to <= count; ++to) {
    for (std::size_t from = 0; from < to; ++from) {
      const Sums run = sums[to] - sums[from];
      const bool arc_before = from > 0 && best[from][1].cost < best[from][0].cost;
      const double before = std::min(best[from][0].cost, best[from][1].cost);
      const double straight = best[from][1].cost + thrift * kStraightCost + cost_of(run, false) / overcount;
      if (straight < best[to][0].cost) best[to][0] = {straight, from, true};
      if (to - from < 2) continue;
      const double arc = before + thrift * kArcCost + cost_of(run, true) / overcount;
      if (arc < best[to][1].cost) best[to][1] = {arc, from, arc_before};
    }
  }
  RecycledVector<TangentPiece> pieces;
  bool arc = best[count][1].cost < best[count][0].cost;
  for (std::size_t to = count; to > 0;) {
    const Best& last = best[to][arc ? 1 : 0];
    pieces.push_back(piece_of(sums[to] - sums[last.from], arc, last.from, to));
    to = last.from;
    arc = last.arc_before;
  }
  std::reverse(pieces.begin(), pieces.end());
  return pieces;
}

/// Where two neighbouring pieces meet: where their lines are nearest to each other, but within them.
double meeting_m(const TangentPiece& a, const TangentPiece& b, double between_m) {
  const Eigen::Vector2d slope = b.slope_rad_m - a.slope_rad_m;
  const Eigen::Vector2d off = b.at(between_m) - a.at(between_m);
  if (!(slope.squaredNorm() > 0.0)) return between_m;
  return std::clamp(between_m - off.dot(slope) / slope.squaredNorm(), a.middle_m, b.middle_m);
}

/// The slope of the nodes about `node`, and how sure a component of it is (1/σ²).
Eigen::Vector3d slope_at(const MeasuredCenterline& line, std::size_t node, std::size_t half, double& weight) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0.0;
  double variance = 0.0;
  for (std::size_t k = 1; k <= half; ++k) {
    const auto step = static_cast<double>(k);
    sum += step * (line.nodes_m[node + k] - line.nodes_m[node - k]);
    squares += 2.0 * step * step;
    variance += (line.covariance_m2[node + k].trace() + line.covariance_m2[node - k].trace()) / 6.0;
  }
  const double floor_m = kLeastOffRadii * line.radius_m;
  variance = variance / static_cast<double>(half) + floor_m * floor_m;
  const double spacing_m = sum.norm() / squares;
  weight = squares * spacing_m * spacing_m / variance;
  return sum.normalized();
}

/// Carries `vector`, across `from`, along to `to` by the smallest rotation.
Eigen::Vector3d carried(const Eigen::Vector3d& vector, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const double cosine = from.dot(to);
  if (cosine < -0.999) return vector;  // a line that turns back on itself has no smallest rotation
  return vector - vector.dot(to) / (1.0 + cosine) * (from + to);
}

PartChain chain_of(const TangentSpace& space, const RecycledVector<TangentPiece>& pieces,
                   const MeasuredCenterline& line, double length_m) {
  PartChain chain;
  const Eigen::Vector2d first = pieces.front().at(pieces.front().arc ? 0.0 : pieces.front().middle_m);
  const Eigen::Vector3d turned = first[0] * space.across[0] + first[1] * space.across[1];
  chain.start_m = line.nodes_m.front();
  chain.direction = (space.direction + turned).normalized();
  chain.towards = carried(space.across[0], space.direction, chain.direction).normalized();
  double at_m = 0.0;
  double plane_rad = 0.0;
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const TangentPiece& piece = pieces[k];
    if (!piece.arc) continue;
    const auto boundary = [&](std::size_t i) {
      const auto& samples = space.samples;
      return meeting_m(pieces[i - 1], pieces[i],
                       0.5 * (samples[pieces[i].from - 1].along_m + samples[pieces[i].from].along_m));
    };
    const double from_m = std::max(at_m, k == 0 ? 0.0 : boundary(k));
    const double to_m = k + 1 == pieces.size() ? length_m : boundary(k + 1);
    const double angle_rad = piece.slope_rad_m.norm() * (to_m - from_m);
    if (!(angle_rad > 0.0)) continue;
    const double direction_rad = std::atan2(piece.slope_rad_m[1], piece.slope_rad_m[0]);
    const double radius_m = std::max((to_m - from_m) / angle_rad, kLeastRadius * line.radius_m);
    chain.bends.push_back({from_m - at_m, direction_rad - plane_rad, angle_rad, radius_m});
    plane_rad = direction_rad;
    at_m = to_m;
  }
  chain.closing_m = std::max(0.0, length_m - at_m);
  return chain;
}

}  // namespace

RecycledVector<double> lengths_along(const MeasuredCenterline& line) {
  RecycledVector<double> along_m(1, 0.0);
  for (std::size_t i = 1; i < line.nodes_m.size(); ++i) {
    along_m.push_back(along_m.back() + (line.nodes_m[i] - line.nodes_m[i - 1]).norm());
  }
  return along_m;
}

TangentSpace tangent_space(const MeasuredCenterline& line) {
  TangentSpace space;
  const std::size_t count = line.nodes_m.size();
  const RecycledVector<double> along_m = lengths_along(line);
  const double spacing_m = along_m.back() / static_cast<double>(count - 1);
  const double window = std::clamp(std::round(kHalfWindowRadii * line.radius_m / spacing_m), 1.0, 50.0);
  Eigen::Vector3d tangent;
  Eigen::Vector3d across[2];
  for (std::size_t i = 1; i + 1 < count; ++i) {
    const std::size_t half = std::min({static_cast<std::size_t>(window), i, count - 1 - i});
    TangentSpace::Sample sample{along_m[i]};
    const Eigen::Vector3d next = slope_at(line, i, half, sample.weight);
    if (space.samples.empty()) {
      space.direction = next;
      space.across[0] = across[0] = next.unitOrthogonal();
      space.across[1] = across[1] = next.cross(across[0]);
    } else {
      const double sine = tangent.cross(next).norm();
      const double turn = sine > 1e-12 ? std::atan2(sine, tangent.dot(next)) / sine : 1.0;
      sample.angle_rad =
          space.samples.back().angle_rad + turn * Eigen::Vector2d(across[0].dot(next), across[1].dot(next));
      for (Eigen::Vector3d& vector : across) vector = carried(vector, tangent, next);
    }
    tangent = next;
    space.samples.push_back(sample);
  }
  return space;
}

PartChain parts_in_tangent_space(const MeasuredCenterline& line, double thrift) {
  TangentSpace space = tangent_space(line);
  const std::size_t stride = (space.samples.size() + kMaxSamples - 1) / kMaxSamples;
  for (std::size_t i = 0; i * stride < space.samples.size(); ++i) space.samples[i] = space.samples[i * stride];
  space.samples.resize((space.samples.size() + stride - 1) / stride);
  const double length_m = lengths_along(line).back();
  // Windows overlap and nodes are correlated: so many samples say what one does.
  const double spacing_m = length_m / static_cast<double>(space.samples.size());
  const double independent_m = std::max(2.0 * kHalfWindowRadii * line.radius_m, line.correlation_m);
  return chain_of(space, cut(space.samples, std::max(1.0, independent_m / spacing_m), thrift), line, length_m);
}

}  // namespace tubetrack
