#include "ablation.hpp"

#include <array>
#include <string>
#include <utility>

namespace tubetrack::bench {

namespace {

using NoisePart = std::pair<const char*, bool DepthNoise::*>;

constexpr std::array<NoisePart, 6> kParts{{{"axial", &DepthNoise::axial},
                                           {"jitter", &DepthNoise::jitter},
                                           {"rounding", &DepthNoise::quantisation},
                                           {"drop-out", &DepthNoise::dropout},
                                           {"mixed", &DepthNoise::mixed},
                                           {"shadow", &DepthNoise::shadow}}};

std::vector<std::pair<std::string, DepthNoise>> steps() {
  std::vector<std::pair<std::string, DepthNoise>> all{{"all", {}}};
  for (const auto& [name, part] : kParts) {
    DepthNoise noise;
    noise.*part = false;
    all.emplace_back(std::string("without ") + name, noise);
  }
  for (const auto& [name, part] : kParts) {
    DepthNoise noise = DepthNoise::none();
    noise.*part = true;
    all.emplace_back(std::string("only ") + name, noise);
  }
  all.emplace_back("none", DepthNoise::none());
  return all;
}

}  // namespace

std::vector<AblationStep> run_ablation(int scenes, std::uint64_t first_seed, int jobs,
                                       const std::function<void()>& progress) {
  std::vector<AblationStep> done;
  for (const auto& [name, noise] : steps()) {
    AblationStep step{name, {}};
    for (const Row& row : rows()) {
      if (row.name != "straight" && row.name != "bent") continue;
      RunOptions options;
      options.noise = noise;
      options.first_seed = first_seed;
      options.single_scenes = scenes;
      options.jobs = jobs;
      add(step.figures, run_row(row, {tubetrack_method()}, options, progress).front().single);
    }
    done.push_back(std::move(step));
  }
  return done;
}

}  // namespace tubetrack::bench
