#include "oni_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "tubetrack/replay/recording.hpp"

namespace tubetrack {

namespace {

/// FNV-1a over the pixels.
std::uint64_t hash_of(const DepthFrame& frame) {
  std::uint64_t hash = 14695981039346656037U;
  for (int v = 0; v < frame.height; ++v) {
    const std::uint16_t* row = frame.row(v);
    for (int u = 0; u < frame.width; ++u) hash = (hash ^ row[u]) * 1099511628211U;
  }
  return hash;
}

Expected<std::vector<std::uint64_t>> hashes_of(const std::filesystem::path& path) {
  auto recording = open_recording(path, {});
  if (!recording) return tl::make_unexpected(recording.error());
  std::vector<std::uint64_t> hashes;
  DepthFrame frame;
  while (true) {
    const FrameOutcome outcome = recording->source->next(frame, std::chrono::milliseconds(1000));
    if (outcome == FrameOutcome::end_of_stream || outcome == FrameOutcome::device_lost) return hashes;
    if (outcome == FrameOutcome::corrupt) hashes.push_back(0);
    if (outcome == FrameOutcome::ok) hashes.push_back(hash_of(frame));
  }
}

/// How many of `seen` are in `written`, in this order: the file also has frames that the program was too late for.
std::int64_t found_in(const std::vector<std::uint64_t>& seen, const std::vector<std::uint64_t>& written) {
  std::int64_t found = 0;
  auto from = written.begin();
  for (const std::uint64_t hash : seen) {
    const auto at = std::find(from, written.end(), hash);
    if (at == written.end()) continue;
    ++found;
    from = std::next(at);
  }
  return found;
}

}  // namespace

void OniCheck::add(const DepthFrame& frame) {
  seen_.back().push_back(hash_of(frame));
}

Expected<std::string> OniCheck::read_back() const {
  std::int64_t seen = 0;
  std::int64_t exact = 0;
  std::size_t written = 0;
  int piece = 0;
  for (const auto& hashes : seen_) {
    ++piece;
    if (hashes.empty()) continue;  // lost again before its first frame, or never back
    const auto path = piece == 1 ? path_
                                 : path_.parent_path() /
                                       fmt::format("{}-{}{}", path_.stem().string(), piece, path_.extension().string());
    const auto in_file = hashes_of(path);
    if (!in_file) return tl::make_unexpected(in_file.error());
    seen += static_cast<std::int64_t>(hashes.size());
    exact += found_in(hashes, *in_file);
    written += in_file->size();
  }
  std::string text =
      fmt::format("{}: read back: {} of {} frames bit for bit, {} in the file", path_.string(), exact, seen, written);
  if (exact < seen) text += "; OpenNI2's codec loses some values: record to a folder to keep every bit";
  return text;
}

}  // namespace tubetrack
