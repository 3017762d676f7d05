#include <fmt/format.h>

#include <fstream>

#include "tubetrack/replay/recorder.hpp"
#include "tubetrack/replay/render.hpp"

namespace tubetrack {

Expected<void> write_synthetic_recording(const Scene& scene, const DepthNoise& noise,
                                         const std::filesystem::path& path) {
  if (auto valid = validate(scene); !valid) return valid;
  StreamInfo info;
  info.name = path.string();
  info.intrinsics = scene.camera;
  info.metres_per_unit = noise.metres_per_unit;
  auto recorder = Recorder::create(path, info);
  if (!recorder) return tl::make_unexpected(recorder.error());
  std::ofstream truth(path / "truth.jsonl");
  for (int frame = 0; frame < scene.frames; ++frame) {
    const RenderedFrame rendered = render_frame(scene, frame, noise);
    truth << truth_json(rendered.truth) << '\n' << std::flush;
    if (!truth) {
      return tl::make_unexpected(Error::failed(
          fmt::format("{}: cannot be written; check the free space and the rights", (path / "truth.jsonl").string())));
    }
    if (auto written = recorder->write(depth_frame(rendered)); !written) return written;
  }
  return {};
}

}  // namespace tubetrack
