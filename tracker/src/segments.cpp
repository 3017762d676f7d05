#include "tubetrack/tracker/segments.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "chain_fit.hpp"
#include "chain_moves.hpp"
#include "tangent_space.hpp"

namespace tubetrack {

namespace {

constexpr int kFitSteps = 12;
constexpr std::size_t kMaxBends = 20;

/// The nodes that can be used: distinct ones.
struct CleanLine {
  std::vector<Eigen::Vector3d> nodes_m;
  std::vector<Eigen::Matrix3d> covariance_m2;
};

std::optional<CleanLine> cleaned(const MeasuredCenterline& line) {
  if (line.covariance_m2.size() != line.nodes_m.size()) return std::nullopt;
  if (!(line.radius_m > 0.0) || !std::isfinite(line.radius_m) || !std::isfinite(line.correlation_m)) return std::nullopt;
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
  return clean;
}

/// The chain with its number of bends brought down as long as that is worth it.
FittedChain simplified(ChainFit fit, const MeasuredCenterline& line) {
  FittedChain fitted = with_uncertainty(fit, line);
  for (bool better = true; better;) {
    better = false;
    for (const PartChain& simpler : simpler_chains(fitted)) {
      ChainFit other = fit_chain(simpler, line, kFitSteps);
      if (!(other.cost < fit.cost)) continue;
      fit = std::move(other);
      fitted = with_uncertainty(fit, line);
      better = true;
      break;
    }
  }
  return fitted;
}

std::vector<Segment> segments_of(const PartChain& chain) {
  std::vector<Segment> segments;
  double at_m = 0.0;
  const auto add = [&](Segment::Type type, double length_m, double bend_radius_m, double bend_angle_rad) {
    if (!(length_m > 0.0)) return;
    segments.push_back({type, at_m, at_m + length_m, bend_radius_m, bend_angle_rad});
    at_m += length_m;
  };
  for (const ChainBend& bend : chain.bends) {
    add(Segment::Type::straight, bend.straight_m, 0.0, 0.0);
    add(Segment::Type::arc, bend.radius_m * bend.angle_rad, bend.radius_m, bend.angle_rad);
  }
  add(Segment::Type::straight, chain.closing_m, 0.0, 0.0);
  return segments;
}

}  // namespace

CenterlineParts cut_into_parts(const MeasuredCenterline& measured) {
  const std::optional<CleanLine> clean = cleaned(measured);
  if (!clean) return {};
  const MeasuredCenterline line{clean->nodes_m, clean->covariance_m2, measured.radius_m, measured.correlation_m};
  PartChain guess = parts_in_tangent_space(line);
  if (guess.bends.size() > kMaxBends) {
    return {{{Segment::Type::free, 0.0, length_of(guess), 0.0, 0.0}}, std::nullopt};
  }
  const FittedChain fitted = simplified(fit_chain(guess, line, kFitSteps), line);
  return {segments_of(fitted.chain), fitted};
}

}  // namespace tubetrack
