#include "chain_moves.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// A bend, or what sets two of them apart, may be noise up to so many σ: BIC will tell.
constexpr double kDoubtfulSigmas = 6.0;
// Bends whose planes differ by more than this are never one.
constexpr double kDoubtfulRotation_rad = 0.8;

double within_half_turn(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * M_PI);
}

/// 0 where there is nothing or nothing is known.
double in_sigmas(double value, double sigma) {
  return value > 0.0 && sigma > 0.0 && std::isfinite(sigma) ? value / sigma : 0.0;
}

PartChain without(const PartChain& chain, std::size_t gone) {
  PartChain simpler = chain;
  const ChainBend bend = chain.bends[gone];
  const double length_m = bend.straight_m + bend.radius_m * bend.angle_rad;
  simpler.bends.erase(simpler.bends.begin() + static_cast<std::ptrdiff_t>(gone));
  if (gone < simpler.bends.size()) {
    simpler.bends[gone].straight_m += length_m;
    simpler.bends[gone].touching = false;
    simpler.bends[gone].rotation_rad += bend.rotation_rad;
  } else {
    simpler.closing_m += length_m;
  }
  return simpler;
}

PartChain touching(const PartChain& chain, std::size_t bend) {
  PartChain simpler = chain;
  simpler.bends[bend].straight_m = 0.0;
  simpler.bends[bend].touching = true;
  return simpler;
}

/// Bend `first` and the next as one: of their length, turning by the sum of their turns.
PartChain merged(const PartChain& chain, std::size_t first) {
  PartChain simpler = chain;
  ChainBend& bend = simpler.bends[first];
  const ChainBend next = chain.bends[first + 1];
  const double length_m = bend.radius_m * bend.angle_rad + next.straight_m + next.radius_m * next.angle_rad;
  const double x = bend.angle_rad + next.angle_rad * std::cos(next.rotation_rad);
  const double y = next.angle_rad * std::sin(next.rotation_rad);
  const double turn_rad = std::atan2(y, x);
  bend.angle_rad = std::hypot(x, y);
  bend.radius_m = length_m / bend.angle_rad;
  bend.rotation_rad += turn_rad;
  simpler.bends.erase(simpler.bends.begin() + static_cast<std::ptrdiff_t>(first) + 1);
  if (first + 1 < simpler.bends.size()) simpler.bends[first + 1].rotation_rad += next.rotation_rad - turn_rad;
  return simpler;
}

}  // namespace

RecycledVector<PartChain> simpler_chains(const FittedChain& fitted) {
  const PartChain& chain = fitted.chain;
  RecycledVector<std::pair<double, PartChain>> found;
  const auto add = [&](double doubt, PartChain simpler) {
    const auto more = [](double one, const auto& other) { return one < other.first; };
    found.emplace(std::upper_bound(found.begin(), found.end(), doubt, more), doubt, std::move(simpler));
  };
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    const double turned = in_sigmas(chain.bends[i].angle_rad, fitted.sigma[i].angle_rad);
    if (turned < kDoubtfulSigmas) add(turned, without(chain, i));
    const double away = in_sigmas(chain.bends[i].straight_m, fitted.sigma[i].straight_m);
    if (chain.bends[i].straight_m > 0.0 && away < kDoubtfulSigmas) add(away, touching(chain, i));
    if (i + 1 == chain.bends.size()) break;
    const ChainBend& next = chain.bends[i + 1];
    const double rotation_rad = std::abs(within_half_turn(next.rotation_rad));
    const double apart = std::max(in_sigmas(next.straight_m, fitted.sigma[i + 1].straight_m),
                                  in_sigmas(rotation_rad, fitted.sigma[i + 1].rotation_rad));
    if (apart < kDoubtfulSigmas && rotation_rad < kDoubtfulRotation_rad) add(apart, merged(chain, i));
  }
  RecycledVector<PartChain> chains;
  chains.reserve(found.size());
  for (auto& [doubt, simpler] : found) chains.push_back(std::move(simpler));
  return chains;
}

}  // namespace tubetrack
