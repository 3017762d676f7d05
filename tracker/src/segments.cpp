#include "tubetrack/tracker/segments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "chain_fit.hpp"
#include "chain_moves.hpp"
#include "tangent_space.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

namespace {

constexpr int kFitSteps = 25;
// The cap at a tube's end bends the last 1.5 radii of a fitted line by up to 0.5 rad, and lengthens it.
constexpr double kUnsureEndRadii = 1.5;
constexpr double kEndSigmaRadii = 0.3;
// More than this is no bent tube.
constexpr std::size_t kMaxBends = 12;
// Arcs with less straight between them than this, in radii or in σ, touch.
constexpr double kTouchingRadii = 0.5;
constexpr double kTouchingSigmas = 3.0;
// Two touching arcs are a compound bend. More are a helix or a hose, cut up.
constexpr std::size_t kMaxTouching = 2;
// In a first guess, noise may cut a bend in pieces; more than these are not worth a fit.
constexpr std::size_t kMaxTouchingInGuess = 5;
// A part that fits worse than this, squared and over its noise, is neither straight nor an arc.
constexpr double kMisfit = 9.0;
constexpr int kLeastResiduals = 8;  // fewer, two a node, can't tell
// Fits tried with fewer bends: a bound on the time for what has no clear bends.
constexpr int kMaxTrials = 5;

/// The nodes that can be used: distinct ones.
struct CleanLine {
  RecycledVector<Eigen::Vector3d> nodes_m;
  RecycledVector<Eigen::Matrix3d> covariance_m2;
};

std::optional<CleanLine> cleaned(const MeasuredCenterline& line) {
  if (line.covariance_m2.size() != line.nodes_m.size()) return std::nullopt;
  if (!(line.radius_m > 0.0) || !std::isfinite(line.radius_m) || !std::isfinite(line.correlation_m + line.unsure_end_m))
    return std::nullopt;
  CleanLine clean;
  for (std::size_t i = 0; i < line.nodes_m.size(); ++i) {
    const Eigen::Matrix3d& covariance = line.covariance_m2[i];
    if (!line.nodes_m[i].allFinite() || !covariance.allFinite() || covariance.diagonal().minCoeff() < 0.0) {
      return std::nullopt;
    }
    if (i > 0 && (line.nodes_m[i] - clean.nodes_m.back()).norm() < 1e-3 * line.radius_m) continue;
    clean.nodes_m.push_back(line.nodes_m[i]);
    clean.covariance_m2.push_back(covariance);
  }
  if (clean.nodes_m.size() < 3) return std::nullopt;
  const double end_m2 = std::pow(kEndSigmaRadii * line.radius_m, 2);
  for (std::size_t i = 0; i < clean.nodes_m.size(); ++i) {
    const Eigen::Vector3d& node_m = clean.nodes_m[i];
    const double from_end_m = std::min((node_m - clean.nodes_m.front()).norm(), (node_m - clean.nodes_m.back()).norm());
    if (from_end_m < line.unsure_end_m) clean.covariance_m2[i].diagonal().array() += end_m2;
  }
  return clean;
}

/// A chain whose number of bends is brought down as long as that is worth it.
ChainFit simplified(ChainFit fit, const MeasuredCenterline& line, FittedChain& fitted) {
  fitted = with_uncertainty(fit, line);
  int trials = 0;
  for (bool better = true; better;) {
    better = false;
    for (const PartChain& simpler : simpler_chains(fitted)) {
      if (trials++ == kMaxTrials) return fit;
      ChainFit other = fit_chain(simpler, line, kFitSteps, fit.chi2);
      if (!(other.cost < fit.cost)) continue;
      fit = std::move(other);
      fitted = with_uncertainty(fit, line);
      better = true;
      break;
    }
  }
  return fit;
}

/// For each bend, whether it belongs to more than `most` arcs that touch.
RecycledVector<bool> in_long_run(const PartChain& chain, const RecycledVector<double>& touching_m, std::size_t most) {
  RecycledVector<bool> in_run(chain.bends.size(), false);
  for (std::size_t from = 0; from < chain.bends.size();) {
    std::size_t to = from + 1;
    while (to < chain.bends.size() && chain.bends[to].straight_m <= touching_m[to]) ++to;
    if (to - from > most)
      std::fill(in_run.begin() + static_cast<std::ptrdiff_t>(from), in_run.begin() + static_cast<std::ptrdiff_t>(to),
                true);
    from = to;
  }
  return in_run;
}

/// A chain's parts; arcs that are in a run are `free`, together with what is between them.
RecycledVector<Segment> segments_of(const PartChain& chain, const RecycledVector<bool>& in_run) {
  RecycledVector<Segment> segments;
  double at_m = 0.0;
  const auto add = [&](Segment::Type type, double length_m, double bend_radius_m, double bend_angle_rad) {
    constexpr double kNothing_m = 1e-9;  // what rounding leaves of a straight that is not there
    if (!(length_m > kNothing_m)) return;
    if (type == Segment::Type::free && !segments.empty() && segments.back().type == type) {
      segments.back().to_m += length_m;
    } else {
      segments.push_back({type, at_m, at_m + length_m, bend_radius_m, bend_angle_rad});
    }
    at_m += length_m;
  };
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    const ChainBend& bend = chain.bends[i];
    const bool within_run = i > 0 && in_run[i - 1] && in_run[i];
    add(within_run ? Segment::Type::free : Segment::Type::straight, bend.straight_m, 0.0, 0.0);
    const double arc_m = bend.radius_m * bend.angle_rad;
    if (in_run[i]) {
      add(Segment::Type::free, arc_m, 0.0, 0.0);
    } else {
      add(Segment::Type::arc, arc_m, bend.radius_m, bend.angle_rad);
    }
  }
  add(Segment::Type::straight, chain.closing_m, 0.0, 0.0);
  return segments;
}

/// Turns parts that the nodes don't follow into free ones; returns whether there are any.
bool free_misfits(const ChainFit& fit, RecycledVector<Segment>& segments) {
  std::size_t node = 0;
  bool any = false;
  for (Segment& segment : segments) {
    double sum = 0.0;
    int count = 0;
    for (; node < fit.foot_m.size() && fit.foot_m[node] <= segment.to_m + 1e-9; ++node) {
      sum += fit.residual.segment<2>(2 * static_cast<Eigen::Index>(node)).squaredNorm();
      count += 2;
    }
    if (count >= kLeastResiduals && sum > kMisfit * count) {
      segment = {Segment::Type::free, segment.from_m, segment.to_m, 0.0, 0.0};
      any = true;
    }
  }
  return any;
}

CenterlineParts parts_of(const ChainFit& fit, FittedChain fitted, const MeasuredCenterline& line, bool& misfit) {
  RecycledVector<double> touching_m;
  touching_m.reserve(fitted.sigma.size());
  for (const BendSigma& sigma : fitted.sigma) {
    touching_m.push_back(std::max(kTouchingRadii * line.radius_m, kTouchingSigmas * sigma.straight_m));
  }
  CenterlineParts parts;
  parts.segments = segments_of(fit.chain, in_long_run(fit.chain, touching_m, kMaxTouching));
  misfit = free_misfits(fit, parts.segments);
  const bool free = std::any_of(parts.segments.begin(), parts.segments.end(),
                                [](const Segment& segment) { return segment.type == Segment::Type::free; });
  if (!free) parts.fitted = std::move(fitted);
  return parts;
}

/// The parts of a line that winds on and on, or has more of them than a bent tube: not worth a fit.
std::optional<CenterlineParts> parts_if_hopeless(const PartChain& guess, double tube_radius_m) {
  if (guess.bends.size() > kMaxBends) {
    return CenterlineParts{{{Segment::Type::free, 0.0, length_of(guess), 0.0, 0.0}}, std::nullopt};
  }
  const RecycledVector<double> touching_m(guess.bends.size(), kTouchingRadii * tube_radius_m);
  const RecycledVector<bool> in_run = in_long_run(guess, touching_m, kMaxTouchingInGuess);
  if (std::find(in_run.begin(), in_run.end(), true) == in_run.end()) return std::nullopt;
  return CenterlineParts{segments_of(guess, in_run), std::nullopt};
}

}  // namespace

MeasuredCenterline fitted_centerline(const Tube& tube) {
  return {tube.centerline_m, tube.node_covariance_m2, tube.radius_m, 2.0 * kKnotSpacingRadii * tube.radius_m,
          kUnsureEndRadii * tube.radius_m};
}

RecycledVector<Segment> segments_of(const PartChain& chain) {
  return segments_of(chain, RecycledVector<bool>(chain.bends.size(), false));
}

CenterlineParts cut_into_parts(const MeasuredCenterline& measured) {
  const std::optional<CleanLine> clean = cleaned(measured);
  if (!clean) return {};
  const MeasuredCenterline line{clean->nodes_m, clean->covariance_m2, measured.radius_m, measured.correlation_m,
                                measured.unsure_end_m};
  CenterlineParts parts;
  double least_cost = std::numeric_limits<double>::infinity();
  // A fit from a guess with too few bends, or from too far away, shows as misfit: another guess, another chance.
  for (const double thrift : {1.0, 0.4}) {
    const PartChain guess = parts_in_tangent_space(line, thrift);
    if (auto hopeless = parts_if_hopeless(guess, line.radius_m)) return parts.segments.empty() ? *hopeless : parts;
    FittedChain fitted;
    const ChainFit fit = simplified(fit_chain(guess, line, kFitSteps), line, fitted);
    if (!(fit.cost < least_cost)) continue;
    least_cost = fit.cost;
    bool misfit = false;
    parts = parts_of(fit, std::move(fitted), line, misfit);
    if (!misfit) break;
  }
  return parts;
}

}  // namespace tubetrack
