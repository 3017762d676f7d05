#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "tubetrack/replay/noise_calibration.hpp"

namespace tubetrack {

namespace {

constexpr std::int64_t kMinPixels = 30;
constexpr double kBinSpread = 0.02;  ///< of σ: what the pixels of a bin differ by beyond chance

constexpr int kTerms = static_cast<int>(kNoiseTerms.size());
enum Term { kConstant, kQuadratic, kReference, kGrazing, kLateral2 };
using Terms = Eigen::Matrix<double, kTerms, 1>;
using Normal = Eigen::Matrix<double, kTerms, kTerms>;
using Free = std::array<bool, kTerms>;

/// What is fitted to: one bin's σ before rounding, and how sure it is.
struct Observation {
  const NoiseBin* bin;
  double sigma_m;
  double uncertainty_m;
};

// The lateral term is fitted as its square: σ² is linear in that, so the fit can leave 0.
Terms terms_of(const NoiseModel& m) {
  Terms terms;
  terms << m.axial_constant_m, m.axial_quadratic_per_m, m.axial_reference_m, m.axial_grazing,
      m.lateral_px * m.lateral_px;
  return terms;
}

NoiseModel with_terms(NoiseModel model, const Terms& t) {
  model.axial_constant_m = t[kConstant];
  model.axial_quadratic_per_m = t[kQuadratic];
  model.axial_reference_m = t[kReference];
  model.axial_grazing = t[kGrazing];
  model.lateral_px = std::sqrt(t[kLateral2]);
  return model;
}

/// σ before rounding, and its derivatives.
double sigma_of(const Terms& t, const NoiseBin& bin, Terms* gradient) {
  const double off = bin.depth_m - t[kReference];
  const double axial = t[kConstant] + t[kQuadratic] * off * off + t[kGrazing] * bin.grazing;
  const double sigma = std::sqrt(axial * axial + t[kLateral2] * bin.slope2_m2_per_px2);
  if (gradient != nullptr) {
    const double by_axial = sigma > 1e-9 ? axial / sigma : 1.0;
    *gradient << by_axial, by_axial * off * off, -2.0 * by_axial * t[kQuadratic] * off, by_axial * bin.grazing,
        bin.slope2_m2_per_px2 / (2.0 * std::max(sigma, 1e-6));
  }
  return sigma;
}

/// Cauchy's loss: a bin that the model does not fit counts less and less.
double loss(double residual) {
  return std::log1p(residual * residual / 9.0) * 9.0;
}
double weight(double residual) {
  return 1.0 / (1.0 + residual * residual / 9.0);
}

double cost_of(const std::vector<Observation>& data, const Terms& terms) {
  double cost = 0.0;
  for (const Observation& o : data) cost += loss((o.sigma_m - sigma_of(terms, *o.bin, nullptr)) / o.uncertainty_m);
  return cost;
}

struct Solution {
  Terms terms;
  Terms uncertainty;  ///< infinite for what is held
};

void add_normal_equations(const std::vector<Observation>& data, const Terms& terms, Normal& normal, Terms& right) {
  normal.setZero();
  right.setZero();
  for (const Observation& o : data) {
    Terms gradient;
    const double residual = (o.sigma_m - sigma_of(terms, *o.bin, &gradient)) / o.uncertainty_m;
    gradient /= o.uncertainty_m;
    normal += weight(residual) * gradient * gradient.transpose();
    right += weight(residual) * residual * gradient;
  }
}

/// Makes the held terms' equations "no change".
void hold(const Free& free, Normal& normal, Terms& right) {
  for (int i = 0; i < kTerms; ++i) {
    if (free[static_cast<std::size_t>(i)]) continue;
    normal.row(i).setZero();
    normal.col(i).setZero();
    normal(i, i) = 1.0;
    right[i] = 0.0;
  }
}

Terms uncertainty_of(const std::vector<Observation>& data, const Terms& terms, const Free& free) {
  Normal normal;
  Terms right;
  add_normal_equations(data, terms, normal, right);
  hold(free, normal, right);
  // Scaled to a unit diagonal, so that "singular" does not depend on units.
  const Terms scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::SelfAdjointEigenSolver<Normal> eigen(scale.asDiagonal() * normal * scale.asDiagonal());
  const Terms values = eigen.eigenvalues().cwiseMax(1e-12).cwiseInverse();
  const Normal covariance = eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
  const double freedom = std::max(static_cast<double>(data.size()) - kTerms, 1.0);
  const double scatter = std::max(cost_of(data, terms) / freedom, 1.0);
  Terms uncertainty = (covariance.diagonal() * scatter).cwiseSqrt().cwiseProduct(scale);
  for (int i = 0; i < kTerms; ++i) {
    if (!free[static_cast<std::size_t>(i)] || normal(i, i) <= 0.0) {
      uncertainty[i] = std::numeric_limits<double>::infinity();
    }
  }
  return uncertainty;
}

/// Levenberg-Marquardt; no term goes below 0.
Solution solve(const std::vector<Observation>& data, Terms terms, const Free& free) {
  double damping = 1e-3;
  double cost = cost_of(data, terms);
  for (int iteration = 0; iteration < 200 && damping < 1e12; ++iteration) {
    Normal normal;
    Terms right;
    add_normal_equations(data, terms, normal, right);
    hold(free, normal, right);
    Normal damped = normal;
    damped.diagonal() += damping * (normal.diagonal() + Terms::Constant(1e-12));
    const Terms next = (terms + damped.ldlt().solve(right)).cwiseMax(0.0);
    const double next_cost = cost_of(data, next);
    if (!(next_cost < cost)) {
      damping *= 10.0;
      continue;
    }
    const bool converged = cost - next_cost < 1e-12 * cost;
    terms = next;
    cost = next_cost;
    damping = std::max(damping * 0.3, 1e-9);
    if (converged) break;
  }
  return {terms, uncertainty_of(data, terms, free)};
}

/// The uncertainty over what is acceptable; above 1, the recording can't tell the term. Values near 0 may be known
/// absolutely only: the floors are a sixth of what the built-in models have.
double vagueness(const Solution& solution, int term) {
  const double value = solution.terms[term];
  const double sigma = solution.uncertainty[term];
  switch (term) {
    case kQuadratic:
      return sigma / std::max(0.15 * value, 0.0003);
    case kReference:
      return sigma / 0.1;
    case kGrazing:
      return sigma / std::max(0.3 * value, 2e-5);
    case kLateral2:
      return sigma / std::max(0.4 * value, 0.01);
    default:
      return 0.0;
  }
}

std::vector<Observation> observations(std::span<const NoiseBin> bins, std::int64_t frames, const RoundingSteps& steps) {
  std::vector<Observation> data;
  for (const NoiseBin& bin : bins) {
    const double step = steps.at(bin.depth_m);
    const double sigma = sigma_before_rounding(bin.variance_m2, step);
    const double readings =
        static_cast<double>(bin.pixels) * static_cast<double>(std::max<std::int64_t>(frames - 1, 1));
    const double by_chance = sigma / std::sqrt(2.0 * readings);
    data.push_back({&bin, sigma, std::hypot(by_chance, kBinSpread * sigma, 0.02 * step + 1e-6)});
  }
  return data;
}

/// Mean variance, without what chance can't explain; for few readings a step at a time is no outlier.
double robust_mean_variance(std::vector<double> variances, double step) {
  double mean = 0.0;
  for (int round = 0; round < 4; ++round) {
    double sum = 0.0;
    std::size_t count = 0;
    for (const double v : variances) {
      if (round > 0 && v > 5.0 * mean + step * step) continue;
      sum += v;
      ++count;
    }
    if (count == 0) break;
    mean = sum / static_cast<double>(count);
  }
  return mean;
}

}  // namespace

std::vector<NoiseBin> noise_bins(std::span<const NoiseSample> samples, const RoundingSteps& steps) {
  std::map<std::pair<int, int>, std::vector<const NoiseSample*>> groups;
  for (const NoiseSample& s : samples) {
    const int depth = static_cast<int>(std::floor(std::log(s.depth_m) / std::log(1.05)));
    groups[{depth, static_cast<int>(s.incidence_rad / (5.0 * std::numbers::pi / 180.0))}].push_back(&s);
  }
  std::vector<NoiseBin> bins;
  for (const auto& [key, group] : groups) {
    NoiseBin bin;
    bin.pixels = static_cast<std::int64_t>(group.size());
    if (bin.pixels < kMinPixels) continue;
    std::vector<double> variances;
    for (const NoiseSample* s : group) {
      const double left = std::numbers::pi / 2.0 - s->incidence_rad;
      bin.depth_m += s->depth_m;
      bin.incidence_rad += s->incidence_rad;
      bin.grazing += s->incidence_rad * s->incidence_rad / (left * left) / std::sqrt(s->depth_m);
      bin.slope2_m2_per_px2 += s->slope_m_per_px * s->slope_m_per_px;
      variances.push_back(s->variance_m2);
    }
    for (double* mean : {&bin.depth_m, &bin.incidence_rad, &bin.grazing, &bin.slope2_m2_per_px2}) {
      *mean /= static_cast<double>(bin.pixels);
    }
    bin.variance_m2 = robust_mean_variance(std::move(variances), steps.at(bin.depth_m));
    bins.push_back(bin);
  }
  return bins;
}

NoiseFit fit_noise_model(std::span<const NoiseBin> bins, std::int64_t frames, const RoundingSteps& steps,
                         const NoiseModel& start) {
  const std::vector<Observation> data = observations(bins, frames, steps);
  Free free;
  free.fill(true);
  const Terms at_start = terms_of(start);
  Terms from = at_start;
  while (true) {
    const Solution solution = solve(data, from, free);
    int vaguest = kConstant;
    double most = 1.0;
    for (int term = 0; term < kTerms; ++term) {
      if (!free[static_cast<std::size_t>(term)] || vagueness(solution, term) <= most) continue;
      most = vagueness(solution, term);
      vaguest = term;
    }
    if (vaguest == kConstant) return {with_terms(start, solution.terms), free};
    free[static_cast<std::size_t>(vaguest)] = false;
    from = solution.terms;
    from[vaguest] = at_start[vaguest];
  }
}

}  // namespace tubetrack
