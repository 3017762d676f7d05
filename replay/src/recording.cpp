#include "tubetrack/replay/recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "image_file.hpp"
#include "oni_recording.hpp"
#include "recorded_sequence.hpp"

namespace tubetrack {

namespace {

constexpr double kTumMetresPerUnit = 1.0 / 5000.0;
constexpr double kNearestMedian_m = 0.2;
constexpr double kFarthestMedian_m = 10.0;
constexpr const char* kIntrinsicsHelp = "--intrinsics fx,fy,cx,cy (pixels, e.g. --intrinsics 525,525,319.5,239.5)";
constexpr const char* kDepthScaleHelp = "--depth-scale (metres per unit, e.g. --depth-scale 0.001 for millimetres)";

/// What a look at a few images tells: enough to refuse a recording before its first frame.
struct Probe {
  int width = 0;  ///< 0: no image could be read
  int height = 0;
  std::filesystem::path sized_by;
  std::vector<std::uint16_t> depths;  ///< some of the returns, in units
};

tl::unexpected<Error> failed(std::string text) {
  return tl::make_unexpected(Error::failed(std::move(text)));
}
tl::unexpected<Error> usage(std::string text) {
  return tl::make_unexpected(Error::usage(std::move(text)));
}

Expected<RecordedSequence> read_sequence(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    const bool missing = !error || status.type() == std::filesystem::file_type::not_found;
    return usage(fmt::format("{}: {}; give the folder of a recording", path.string(),
                             missing ? "no such file or folder" : error.message()));
  }
  if (!std::filesystem::is_directory(status)) {
    if (has_depth_image_extension(path)) return read_image_folder(path);
    return usage(
        fmt::format("{}: no recording; give a folder with depth.txt, scene_camera.json, or 16-bit .png, .tiff "
                    "or .pgm images",
                    path.string()));
  }
  if (std::filesystem::exists(path / "depth.txt", error)) return read_tum_recording(path);
  if (std::filesystem::exists(path / "scene_camera.json", error)) return read_bop_recording(path);
  return read_image_folder(path);
}

Expected<void> probe_image(const DepthImage& image, const std::filesystem::path& path, const RecordedSequence& sequence,
                           Probe& probe) {
  if (probe.width == 0) {
    probe.width = image.width;
    probe.height = image.height;
    probe.sized_by = path;
  } else if (image.width != probe.width || image.height != probe.height) {
    return failed(fmt::format("{}: mixed sizes: {} is {} x {}, {} is {} x {}; a recording takes one size: split it",
                              sequence.path.string(), probe.sized_by.filename().string(), probe.width, probe.height,
                              path.filename().string(), image.width, image.height));
  }
  constexpr int step = 3;
  for (int v = 0; v < image.height; v += step) {
    const auto* row = image.pixels + static_cast<std::size_t>(v) * (image.stride_bytes / sizeof(std::uint16_t));
    for (int u = 0; u < image.width; u += step) {
      if (row[u] != 0) probe.depths.push_back(row[u]);
    }
  }
  return {};
}

/// Looks at the first two readable images and the last one: a few milliseconds, and what is wrong with a whole
/// recording shows in them. What is wrong with a single image is that frame's affair.
Expected<Probe> probe_images(const RecordedSequence& sequence) {
  Probe probe;
  int read = 0;
  const auto look_at = [&](const RecordedFrame& frame) -> Expected<void> {
    const auto image = read_depth_image(frame.image);
    if (!image && image.error().kind == ImageProblem::Kind::wrong_type && read == 0)
      return failed(image.error().message);
    if (!image) return {};
    ++read;
    return probe_image(*image, frame.image, sequence, probe);
  };
  std::size_t i = 0;
  for (; i < sequence.frames.size() && read < 2; ++i) {
    if (auto looked = look_at(sequence.frames[i]); !looked) return tl::make_unexpected(looked.error());
  }
  if (i < sequence.frames.size()) {
    if (auto looked = look_at(sequence.frames.back()); !looked) return tl::make_unexpected(looked.error());
  }
  return probe;
}

/// `--intrinsics` describes the whole camera: the file's numbers and its distortion no longer count.
Expected<Intrinsics> intrinsics_from_flag(RecordedSequence& sequence, const std::array<double, 4>& flag) {
  Intrinsics in;
  in.fx_px = flag[0];
  in.fy_px = flag[1];
  in.cx_px = flag[2];
  in.cy_px = flag[3];
  in.width = in.height = 1;  // validated later, with the size
  if (auto valid = validate(in); !valid) {
    return usage(
        fmt::format("--intrinsics {:g},{:g},{:g},{:g}: {}", flag[0], flag[1], flag[2], flag[3], valid.error().message));
  }
  if (!sequence.camera) return in;
  const Intrinsics& file = sequence.camera->intrinsics;
  in.width = file.width;
  in.height = file.height;
  if (std::array{file.fx_px, file.fy_px, file.cx_px, file.cy_px} != flag || file.has_distortion()) {
    sequence.notes.push_back(fmt::format(
        "{}: says fx,fy,cx,cy = {:g},{:g},{:g},{:g}{}; --intrinsics {:g},{:g},{:g},{:g} without distortion is used",
        sequence.camera_file.string(), file.fx_px, file.fy_px, file.cx_px, file.cy_px,
        file.has_distortion() ? " with distortion" : "", flag[0], flag[1], flag[2], flag[3]));
  }
  return in;
}

Expected<Intrinsics> choose_intrinsics(RecordedSequence& sequence, const RecordingOptions& options,
                                       const Probe& probe) {
  const std::string file = sequence.camera_file.string();
  Intrinsics in;
  if (options.intrinsics_px) {
    const auto flag = intrinsics_from_flag(sequence, *options.intrinsics_px);
    if (!flag) return flag;
    in = *flag;
  } else if (sequence.camera) {
    in = sequence.camera->intrinsics;
  } else {
    return usage(fmt::format("{}: intrinsics are missing ({} is not there); give {}", sequence.path.string(), file,
                             kIntrinsicsHelp));
  }
  const bool size_told = sequence.camera && (in.width != 0 || in.height != 0);
  if (probe.width == 0 && !size_told) {
    return failed(fmt::format("{}: none of its {} image(s) can be read (first: {}); record or copy them again",
                              sequence.path.string(), sequence.frames.size(), sequence.frames.front().image.string()));
  }
  if (probe.width != 0 && size_told && (in.width != probe.width || in.height != probe.height)) {
    const std::string clash =
        fmt::format("{}: image_width x image_height is {} x {}, but {} is {} x {}", file, in.width, in.height,
                    probe.sized_by.filename().string(), probe.width, probe.height);
    if (!options.intrinsics_px) {
      return failed(fmt::format("{}; take the file that belongs to these images, or give {}", clash, kIntrinsicsHelp));
    }
    sequence.notes.push_back(clash + "; the images' size is used");
  }
  if (probe.width != 0) {
    in.width = probe.width;
    in.height = probe.height;
  }
  if (auto valid = validate(in); !valid) {
    return failed(fmt::format("{}: {}; correct it or give {}", file, valid.error().message, kIntrinsicsHelp));
  }
  return in;
}

struct DepthScale {
  double metres_per_unit;
  std::string origin;  ///< for messages
  bool from_file;      ///< else from the flag, or assumed
};

Expected<DepthScale> choose_depth_scale(RecordedSequence& sequence, const RecordingOptions& options) {
  const std::optional<double> file = sequence.camera.value_or(CameraInfo{}).metres_per_unit;
  const std::string file_name = sequence.camera_file.string();
  const auto usable = [](double scale) { return std::isfinite(scale) && scale > 0.0; };
  if (options.metres_per_unit) {
    const double flag = *options.metres_per_unit;
    if (!usable(flag)) {
      return usage(fmt::format("--depth-scale {:g}: takes metres per unit, above 0, e.g. 0.001 for millimetres", flag));
    }
    if (file && std::abs(*file - flag) > 1e-9 * flag) {
      sequence.notes.push_back(
          fmt::format("{}: says depth_scale {:g}; --depth-scale {:g} is used", file_name, *file, flag));
    }
    return DepthScale{flag, "from --depth-scale", false};
  }
  if (file) {
    if (!usable(*file)) {
      return failed(fmt::format("{}: depth_scale: got {:g}, takes metres per unit, above 0; correct it or give {}",
                                file_name, *file, kDepthScaleHelp));
    }
    return DepthScale{*file, fmt::format("from {}", file_name), true};
  }
  sequence.notes.push_back(
      fmt::format("{}: no depth_scale given, TUM's 1/5000 m per unit assumed; if that is wrong, give {}",
                  sequence.path.string(), kDepthScaleHelp));
  return DepthScale{kTumMetresPerUnit, "TUM's 1/5000 assumed", false};
}

Expected<void> check_median_depth(const RecordedSequence& sequence, const DepthScale& scale, Probe& probe) {
  if (probe.depths.empty()) return {};
  const auto middle = probe.depths.begin() + static_cast<std::ptrdiff_t>(probe.depths.size() / 2);
  std::nth_element(probe.depths.begin(), middle, probe.depths.end());
  const double median_m = *middle * scale.metres_per_unit;
  if (median_m >= kNearestMedian_m && median_m <= kFarthestMedian_m) return {};
  std::string text = fmt::format(
      "{}: median depth {:.3g} m ({} units of {:g} m, {}) is outside {:g} to {:g} m; give {}", sequence.path.string(),
      median_m, *middle, scale.metres_per_unit, scale.origin, kNearestMedian_m, kFarthestMedian_m, kDepthScaleHelp);
  return scale.from_file ? failed(std::move(text)) : usage(std::move(text));
}

/// Frames [begin, end) of the recording that the range asks for, at least one.
struct Clip {
  std::int64_t begin;
  std::int64_t end;
};

Expected<Clip> clip_range(const RecordedSequence& sequence, FrameRange range) {
  const auto count = static_cast<std::int64_t>(sequence.frames.size());
  const std::int64_t end = std::min(range.end.value_or(count), count);
  if (range.begin < 0 || range.begin >= end) {
    return usage(
        fmt::format("--frames {}:{}: no frame of {} is in it, which has frames 0 to {}; takes A:B with A < B, B "
                    "not included",
                    range.begin, range.end ? std::to_string(*range.end) : "", sequence.path.string(), count - 1));
  }
  return Clip{range.begin, end};
}

}  // namespace

Expected<OpenedRecording> open_recording(const std::filesystem::path& path, const RecordingOptions& options) {
  std::error_code ignored;
  if (path.extension() == ".oni" && std::filesystem::is_regular_file(path, ignored)) {
    auto source = open_oni_recording(path, options);
    if (!source) return tl::make_unexpected(source.error());
    return OpenedRecording{std::move(*source), {}};
  }
  auto sequence = read_sequence(path);
  if (!sequence) return tl::make_unexpected(sequence.error());
  const auto range = clip_range(*sequence, options.frames);
  if (!range) return tl::make_unexpected(range.error());
  auto probe = probe_images(*sequence);
  if (!probe) return tl::make_unexpected(probe.error());
  const auto intrinsics = choose_intrinsics(*sequence, options, *probe);
  if (!intrinsics) return tl::make_unexpected(intrinsics.error());
  const auto scale = choose_depth_scale(*sequence, options);
  if (!scale) return tl::make_unexpected(scale.error());
  if (auto plausible = check_median_depth(*sequence, *scale, *probe); !plausible) {
    return tl::make_unexpected(plausible.error());
  }
  StreamInfo info{path.string(), *intrinsics, scale->metres_per_unit, sequence->has_poses, range->end - range->begin};
  OpenedRecording opened;
  opened.notes = std::move(sequence->notes);
  opened.source = play_sequence(std::move(sequence->frames), std::move(info), range->begin, range->end, options.pace);
  return opened;
}

}  // namespace tubetrack
