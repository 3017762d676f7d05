#include "kept_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace tubetrack {

namespace fs = std::filesystem;

namespace {

/// With links followed as far as the path exists, and no slash at the end.
fs::path resolved(const std::string& path) {
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(path, ignored);
  return whole.has_filename() ? whole : whole.parent_path();
}

bool lies_in(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

tl::unexpected<Error> taken(const char* flag, const std::string& path, const char* by) {
  return tl::make_unexpected(Error::usage(fmt::format("{} {}: {}; give another name", flag, path, by)));
}

}  // namespace

Expected<void> keep_recording(const std::string& recording, const std::string& out, const std::string& overlay,
                              const std::string& save_heightmap) {
  if (recording.empty()) return {};
  const fs::path whole = resolved(recording);
  const auto is_of_recording = [&](const fs::path& path) {
    std::error_code ignored;
    return !path.empty() && fs::is_regular_file(path, ignored) && lies_in(resolved(path.string()), whole);
  };
  const fs::path file(out);
  const bool results = file.extension() == ".jsonl" && file.filename() != "truth.jsonl";
  if (!results && is_of_recording(file)) return taken("--out", out, "is a file of the recording");
  const fs::path heights(save_heightmap);
  if (is_of_recording(heights) || (!heights.empty() && is_of_recording(fs::path(heights).replace_extension(".json"))))
    return taken("--save-heightmap", save_heightmap, "is, or has beside it, a file of the recording");
  if (overlay.empty()) return {};
  const fs::path pictures = resolved(overlay);
  if (pictures == whole || pictures == whole / "depth")
    return taken("--overlay", overlay, "holds the recording itself");
  return {};
}

Expected<void> keep_others(const std::string& flag, const std::string& target) {
  if (target.empty()) return {};
  const char* const played = std::getenv("TUBETRACK_VIRTUAL_DEVICE");
  if (played != nullptr && *played != '\0' && resolved(played) == resolved(target))
    return taken(flag.c_str(), target, "is what the virtual device plays");
  std::error_code ignored;
  if (fs::path(target).extension() != ".oni" || !fs::exists(target, ignored)) return {};
  constexpr std::string_view kMagic = "NI10";
  std::string start(kMagic.size(), ' ');
  std::ifstream(target, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
  const bool empty = fs::is_regular_file(target, ignored) && fs::file_size(target, ignored) == 0;
  if (start != kMagic && !empty) return taken(flag.c_str(), target, "is there, and no OpenNI2 recording");
  return {};
}

}  // namespace tubetrack
