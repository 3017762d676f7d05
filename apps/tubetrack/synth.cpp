#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "commands.hpp"
#include "run.hpp"
#include "tubetrack/replay/render.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kSynthFooter =
    R"(Examples:
  tubetrack synth --list
  tubetrack synth bent desk/                          then: tubetrack replay desk/, tubetrack eval desk/
  tubetrack synth crossing exact/ --no-noise --frames 1
  tubetrack synth my-cell.json cell/ --seed 7         a scene of your own (docs/scene.md)

Exit codes: 0 done, 1 it failed while writing, 2 wrong usage.)";

struct SynthOptions {
  std::string scene, path;
  bool list = false, no_noise = false;
  bool no_axial = false, no_jitter = false, no_quantisation = false;
  bool no_dropout = false, no_mixed = false, no_shadow = false;
  std::optional<int> frames;
  std::optional<std::uint64_t> seed;
  std::optional<double> metres_per_unit;
};

DepthNoise noise_from(const SynthOptions& options) {
  DepthNoise noise = options.no_noise ? DepthNoise::none() : DepthNoise{};
  noise.axial = noise.axial && !options.no_axial;
  noise.jitter = noise.jitter && !options.no_jitter;
  noise.quantisation = noise.quantisation && !options.no_quantisation;
  noise.dropout = noise.dropout && !options.no_dropout;
  noise.mixed = noise.mixed && !options.no_mixed;
  noise.shadow = noise.shadow && !options.no_shadow;
  noise.metres_per_unit = options.metres_per_unit.value_or(noise.metres_per_unit);
  return noise;
}

int run_synth(const SynthOptions& options) {
  if (options.list) {
    for (const std::string_view name : preset_names()) fmt::print("{}\n", name);
    return 0;
  }
  if (options.scene.empty() || options.path.empty()) {
    return report_error(Error::usage(
        "synth: SCENE or PATH is missing; takes a preset (see synth --list) or a .json file, and a folder to write"));
  }
  // Below 10 µm nothing beyond 0.65 m fits in 16 bits, above 10 cm no tube is more than one step.
  if (options.metres_per_unit && !(*options.metres_per_unit >= 1e-5 && *options.metres_per_unit <= 0.1)) {
    return report_error(Error::usage(
        fmt::format("--depth-scale: got {:g}, takes metres per unit, 0.00001 to 0.1", *options.metres_per_unit)));
  }
  auto scene = load_scene(options.scene);
  if (!scene) return report_error(scene.error());
  scene->frames = options.frames.value_or(scene->frames);
  scene->seed = options.seed.value_or(scene->seed);
  if (scene->frames < 1 || scene->frames > 1000000) {
    return report_error(Error::usage(fmt::format("--frames: got {}, takes 1 to 1000000", scene->frames)));
  }
  const DepthNoise noise = noise_from(options);
  auto written = write_synthetic_recording(*scene, noise, options.path);
  if (written) written = write_noise_model(noise.sensor, std::filesystem::path(options.path) / "noise.json");
  if (!written) return report_error(written.error());
  fmt::print("{}: {}, {} x {} pixels, frames {}, tubes {}, seed {}{}\n", options.path, scene->name, scene->camera.width,
             scene->camera.height, scene->frames, scene->tubes.size(), scene->seed,
             options.no_noise ? ", no noise" : "");
  return 0;
}

}  // namespace

void add_synth(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<SynthOptions>();
  CLI::App* command = app.add_subcommand("synth", "render a synthetic scene to a recording with its tube truth");
  command->footer(kSynthFooter);
  command->add_option("SCENE", options->scene, "a preset (--list) or a scene file, .json (docs/scene.md)");
  command->add_option("PATH", options->path, "folder to write; an earlier recording in it is overwritten");
  command->add_flag("--list", options->list, "print the presets' names and end");
  command->add_option("--frames", options->frames, "number of frames, in place of the scene's");
  // CLI11 lets a number below 0 wrap around.
  command->add_option("--seed", options->seed, "seed of the noise, in place of the scene's")
      ->check([](const std::string& text) { return std::string(text.starts_with('-') ? "is below 0" : ""); });
  command->add_option("--depth-scale", options->metres_per_unit,
                      "metres per unit of the 16-bit images [0.001; 0.0001 with --no-noise]");
  command->add_flag("--no-noise", options->no_noise, "exact depth: every part of the noise off");
  command->add_flag("--no-axial", options->no_axial, "no Gaussian noise along z");
  command->add_flag("--no-jitter", options->no_jitter, "no lateral jitter");
  command->add_flag("--no-quantisation", options->no_quantisation, "no rounding of the disparity");
  command->add_flag("--no-dropout", options->no_dropout, "no pixels lost at grazing incidence and depth edges");
  command->add_flag("--no-mixed", options->no_mixed, "no pixels between the two depths of an edge");
  command->add_flag("--no-shadow", options->no_shadow, "no shadow of the projector");
  command->callback([options, &exit_code] { exit_code = run_synth(*options); });
}

}  // namespace tubetrack
