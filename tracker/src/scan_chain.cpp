#include "scan_chain.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "chain_fit.hpp"
#include "chain_residual.hpp"
#include "chain_step.hpp"

namespace tubetrack {

namespace {

// More surfels than these say no more, and cost.
constexpr std::size_t kMaxPoints = 200'000;
constexpr double kTuning = 3.0;  // a residual of 3 σ counts a quarter
// At an end a rounded edge bends the surface.
constexpr double kUnfittedRadii = 0.25;

struct ChainPointSet {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<double> area, foot_m;
  double line_cost = 0.0;  ///< of the tube's own line
  double sum_area = 0.0;
};

/// What a residual costs: its square for small ones, 1 at most (Geman-McClure).
double robust_cost(double residual_m, double scale_m) {
  const double far = residual_m / (kTuning * scale_m);
  return far * far / (1.0 + far * far);
}

/// The tube's surfels between its ends, each with its place along the tube's own line as a first foot.
ChainPointSet points_of(const ScanTube& tube, const SurfelGrid& grid, double scale_m) {
  const double margin = kUnfittedRadii / kKnotSpacingRadii;
  std::vector<SurfacePoint> near = points_near(grid, {}, tube.line);
  std::erase_if(near, [&](const SurfacePoint& point) {
    return point.t < tube.evidence.t_begin + margin || point.t > tube.evidence.t_end - margin;
  });
  const std::size_t stride = near.size() / kMaxPoints + 1;
  constexpr int kPerSpan = 4;
  const int steps = kPerSpan * static_cast<int>(tube.line.model.spline.spans());
  std::vector<double> along_m{0.0};
  Eigen::Vector3d last_m = point_at(tube.line.model.spline, 0.0);
  for (int i = 1; i <= steps; ++i) {
    const Eigen::Vector3d next_m = point_at(tube.line.model.spline, static_cast<double>(i) / kPerSpan);
    along_m.push_back(along_m.back() + (next_m - last_m).norm());
    last_m = next_m;
  }
  const auto length_at = [&](double t) {
    const double at = std::clamp(t * kPerSpan, 0.0, steps - 1e-9);
    const auto k = static_cast<std::size_t>(at);
    return along_m[k] + (at - static_cast<double>(k)) * (along_m[k + 1] - along_m[k]);
  };
  const double begin_m = length_at(tube.evidence.t_begin);
  ChainPointSet set;
  for (std::size_t i = 0; i < near.size(); i += stride) {
    const CellSurfel& surfel = grid.surfels[near[i].surfel];
    set.points_m.emplace_back((surfel.position_m - near[i].lift_m * near[i].inward).cast<double>());
    set.area.push_back(std::max(1e-3, static_cast<double>(surfel.weight)));
    set.foot_m.push_back(length_at(near[i].t) - begin_m);
    set.sum_area += set.area.back();
    set.line_cost +=
        set.area.back() * robust_cost(static_cast<double>(near[i].distance_m) - tube.line.model.radius_m, scale_m);
  }
  return set;
}

/// A chain with its radius, and what the points make of it: robust cost and the equations of a step.
struct SurfaceFit {
  PartChain chain;
  double radius_m = 0.0;
  double cost = 0.0;
  ChainEquations equations;
};

/// A point's foot on the chain, brought nearer, and what is left.
struct SurfaceResidual {
  ChainPoint at;
  Eigen::Vector3d outward;
  double residual_m = 0.0;
  double weight = 0.0;
  double pull = 0.0;  ///< how much of a move against the residual it takes back: the weighted residual's derivative
};

SurfaceResidual residual_of(const PlacedChain& placed, double radius_m, double scale_m, std::size_t i,
                            ChainPointSet& set) {
  SurfaceResidual one;
  set.foot_m[i] = nearer_foot(placed, set.points_m[i], set.foot_m[i], radius_m);
  one.at = point_on(placed, set.foot_m[i]);
  const Eigen::Vector3d off_m = set.points_m[i] - one.at.position_m;
  const double distance_m = off_m.norm();
  one.residual_m = distance_m - radius_m;
  one.outward = off_m / std::max(distance_m, 1e-12);
  const double far = one.residual_m / (kTuning * scale_m);
  const double sigma_m = scale_m * (1.0 + far * far);
  one.weight = set.area[i] / (sigma_m * sigma_m);
  one.pull = one.weight * (1.0 - 3.0 * far * far) / (1.0 + far * far);
  return one;
}

/// Of every `stride`-th point.
void linearise(double scale_m, std::size_t stride, bool radius_known, ChainPointSet& set, SurfaceFit& fit) {
  const PlacedChain placed = place(fit.chain);
  std::vector<PartSums> parts(2 * fit.chain.bends.size() + 1);
  fit.cost = 0.0;
  for (std::size_t i = 0; i < set.points_m.size(); i += stride) {
    const SurfaceResidual one = residual_of(placed, fit.radius_m, scale_m, i, set);
    fit.cost += set.area[i] * robust_cost(one.residual_m, scale_m);
    parts[part_of(one.at)].add(one.at, one.outward, placed, fit.chain.start_m, one.weight, one.residual_m);
  }
  put_together(parts, carries_of(placed, fit.chain), fit.equations.normal, fit.equations.gradient);
  if (!radius_known) return;
  const Eigen::Index last = fit.equations.gradient.size() - 1;
  fit.equations.normal.row(last).setZero();
  fit.equations.normal.col(last).setZero();
  fit.equations.normal(last, last) = 1.0;
  fit.equations.gradient[last] = 0.0;
}

/// How much more the points err together than each for itself would let expect: weighted residuals, summed over
/// patches of the surface, one radius by a sixth of the section.
double err_together(double scale_m, ChainPointSet& set, const SurfaceFit& fit) {
  constexpr double kSectors = 6.0;
  const PlacedChain placed = place(fit.chain);
  std::map<std::pair<int, int>, double> patches;
  double weights = 0.0, pulls = 0.0;
  for (std::size_t i = 0; i < set.points_m.size(); ++i) {
    const SurfaceResidual one = residual_of(placed, fit.radius_m, scale_m, i, set);
    const double angle_rad =
        std::atan2(one.outward.dot(one.at.tangent.cross(one.at.normal)), one.outward.dot(one.at.normal));
    patches[{static_cast<int>(std::floor(set.foot_m[i] / fit.radius_m)),
             static_cast<int>(std::floor(angle_rad * kSectors / (2.0 * std::numbers::pi)))}] +=
        one.weight * one.residual_m;
    weights += one.weight;
    pulls += one.pull;
  }
  double squares = 0.0;
  for (const auto& [patch, sum] : patches) squares += sum * sum;
  const auto filled = static_cast<double>(patches.size());
  const auto parameters = static_cast<double>(fit.equations.gradient.size());
  const double together = std::max(1.0, squares / weights * filled / std::max(1.0, filled - parameters));
  // The equations have the weights for what pulls the chain back, and what stands out pulls less than its weight.
  constexpr double kLeastPull = 0.3;
  const double pull = std::max(kLeastPull, pulls / weights);
  return together / (pull * pull);
}

/// Levenberg-Marquardt with points taken to err by `scale_m`, until a step gains less than such a part of the cost.
/// False where it breaks down.
bool improve(double scale_m, std::size_t stride, int max_steps, double converged, bool radius_known, ChainPointSet& set,
             SurfaceFit& fit) {
  double damping = 1e-4;
  linearise(scale_m, stride, radius_known, set, fit);
  for (int i = 0; i < max_steps; ++i) {
    ChainEquations equations = fit.equations;
    hold_undecided(fit.chain, equations);
    equations.normal.diagonal() *= 1.0 + damping;
    const Eigen::VectorXd step = solve(fit.chain, equations);
    if (!step.allFinite()) return false;
    SurfaceFit next{fit.chain, fit.radius_m, 0.0, {}};
    move_chain(next.chain, step);
    if (!radius_known) next.radius_m += std::clamp(step[step.size() - 1], -0.1 * fit.radius_m, 0.1 * fit.radius_m);
    linearise(scale_m, stride, radius_known, set, next);
    const double gain = fit.cost - next.cost;
    if (gain > 0.0) {
      fit = std::move(next);
      damping *= 0.1;
    } else {
      damping = std::max(1e-4, 10.0 * damping);
    }
    if (std::abs(gain) < converged * fit.cost) break;
  }
  return true;
}

/// The chain with straights between all bends and at both ends. Nodes can't tell whether there are, least of all at an
/// end, the surface can: a straight that is too short grows in the fit, and one that is not there shrinks to 0.
PartChain opened(PartChain chain, double radius_m) {
  constexpr double kBetweenRadii = 0.5, kEndRadii = 1.5, kMostOfBend = 0.4;
  const auto shorten = [](ChainBend& bend, double by_m) {
    const double angle_rad = std::min(by_m / bend.radius_m, kMostOfBend * bend.angle_rad);
    bend.angle_rad -= angle_rad;
    return bend.radius_m * angle_rad;
  };
  ChainBend& first = chain.bends.front();
  const double end_m = kEndRadii * radius_m;
  if (first.straight_m < end_m) {
    const PlacedChain placed = place(chain);
    first.straight_m += shorten(first, end_m - first.straight_m);
    const ChainPoint at = point_on(placed, first.straight_m);
    chain.start_m = at.position_m - first.straight_m * at.tangent;
    chain.direction = at.tangent;
    chain.towards = at.normal;
    first.rotation_rad = 0.0;
  }
  for (std::size_t i = 1; i < chain.bends.size(); ++i) {
    const double missing_m = kBetweenRadii * radius_m - chain.bends[i].straight_m;
    if (missing_m <= 0.0) continue;
    chain.bends[i].straight_m +=
        shorten(chain.bends[i - 1], 0.5 * missing_m) + shorten(chain.bends[i], 0.5 * missing_m);
  }
  if (chain.closing_m < end_m) shorten(chain.bends.back(), end_m - chain.closing_m);
  for (ChainBend& bend : chain.bends) bend.touching = false;
  return chain;
}

/// The chain from one end of the tube to the other; false where that is not in a straight.
bool trim_to(const Eigen::Vector3d& begin_m, const Eigen::Vector3d& end_m, double radius_m, PartChain& chain) {
  const double first_m = nearer_foot(place(chain), begin_m, 0.0, radius_m);
  if (first_m >= chain.bends.front().straight_m) return false;
  chain.start_m += first_m * chain.direction;
  chain.bends.front().straight_m -= first_m;
  const PlacedChain placed = place(chain);
  chain.closing_m = nearer_foot(placed, end_m, length_of(chain), radius_m) - placed.last_from_m;
  chain.towards = placed.bends.front().towards;
  chain.bends.front().rotation_rad = 0.0;
  return chain.closing_m > 0.0;
}

}  // namespace

std::optional<FittedChain> fit_chain_to_surface(const PartChain& initial, const ScanTube& tube, const SurfelGrid& grid,
                                                const ScanTubesConfig& config) {
  if (initial.bends.empty() || tube.line.closed()) return std::nullopt;
  constexpr double kLeastScaleSteps = 0.02;
  const double scale_m = std::max(tube.fit.scale_m, kLeastScaleSteps * config.grid_step_m);
  ChainPointSet set = points_of(tube, grid, scale_m);
  SurfaceFit fit{opened(initial, tube.line.model.radius_m), tube.line.model.radius_m, 0.0, {}};
  if (set.points_m.size() < 4 * static_cast<std::size_t>(parameter_count(fit.chain))) return std::nullopt;
  const bool radius_known = config.radius_m.has_value();
  // At first points are taken to err by much, or what a bend's end is far from would not count.
  constexpr double kFirstScaleRadii = 0.3;
  constexpr int kFirstSteps = 6, kLastSteps = 30;
  // On the way there few points do, and no step has to be the last word.
  constexpr double kOnTheWay = 1e-3, kAtLast = 1e-6, kPointsPerParameter = 30.0;
  const double enough = kPointsPerParameter * static_cast<double>(parameter_count(fit.chain));
  const auto few = static_cast<std::size_t>(std::clamp(static_cast<double>(set.points_m.size()) / enough, 4.0, 64.0));
  for (double wide_m = kFirstScaleRadii * fit.radius_m; wide_m > 2.0 * scale_m; wide_m *= 0.3) {
    if (!improve(wide_m, few, kFirstSteps, kOnTheWay, radius_known, set, fit)) return std::nullopt;
  }
  if (!improve(scale_m, few, kLastSteps, kOnTheWay, radius_known, set, fit) ||
      !improve(scale_m, 1, kLastSteps, kAtLast, radius_known, set, fit))
    return std::nullopt;
  constexpr double kAsGood = 1.3, kMisfits = 0.005;
  if (!(fit.cost < kAsGood * set.line_cost + kMisfits * set.sum_area)) return std::nullopt;
  const Eigen::MatrixXd covariance =
      err_together(scale_m, set, fit) * inverse_where_decided(fit.chain, fit.equations.normal);
  const Spline& spline = tube.line.model.spline;
  if (!trim_to(point_at(spline, tube.evidence.t_begin), point_at(spline, tube.evidence.t_end), fit.radius_m, fit.chain))
    return std::nullopt;
  // Within a radius of an end a bend may as well go on to it: where the nodes saw no straight there is none.
  const double told_apart_m = fit.radius_m;
  if (!(initial.bends.front().straight_m > 0.0) && fit.chain.bends.front().straight_m < told_apart_m)
    return std::nullopt;
  if (!(initial.closing_m > 0.0) && fit.chain.closing_m < told_apart_m) return std::nullopt;
  // What all of the section errs by alike, measured on meshes (docs/bends.md). Of a part of it, which tells an end's
  // place and tilt less well apart, it is more.
  constexpr double kEndSteps = 0.005;
  const double whole = 2.0 * std::numbers::pi / std::max(1.0, tube.evidence.arc_rad);
  const double all_m = kEndSteps * config.grid_step_m * std::pow(whole, 2.5);
  return with_covariance(fit.chain, covariance, std::hypot(all_m, tube.evidence.begin_sigma_m),
                         std::hypot(all_m, tube.evidence.end_sigma_m));
}

}  // namespace tubetrack
