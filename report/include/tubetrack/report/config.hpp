#pragma once

#include <filesystem>
#include <string>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tracker_config.hpp"

namespace tubetrack {

/// A JSON object whose keys are the fields of TrackerConfig (`noise`: a name, or an object with the fields of
/// NoiseModel); what it does not name keeps its default. An unknown key, a wrong type or a value out of range is a
/// usage error that names the file, the key and what it takes.
Expected<TrackerConfig> read_config(const std::filesystem::path& path, const TrackerConfig& defaults = {});
/// The same from text; `name` stands for the file in messages.
Expected<TrackerConfig> parse_config(const std::string& text, const std::string& name,
                                     const TrackerConfig& defaults = {});

/// A JSON object with the fields of NoiseModel (docs/noise.md), refused like a config. What it does not name keeps the
/// value of kinect1; without a name, the model has the file's.
Expected<NoiseModel> read_noise_model(const std::filesystem::path& path);
/// The model as JSON that read_noise_model reads back to the same values.
std::string noise_model_text(const NoiseModel& model);
/// The same into a file. The error names it.
Expected<void> write_noise_model(const NoiseModel& model, const std::filesystem::path& path);

/// Every setting as JSON that parse_config reads back to the same values.
std::string config_text(const TrackerConfig& config);

}  // namespace tubetrack
