#include "recording_player.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

namespace tubetrack {

namespace {

constexpr std::chrono::milliseconds kPoll{2};
constexpr std::chrono::milliseconds kStartPatience{250};

tl::unexpected<Error> refuse(const char* variable, const std::string& got, const char* takes) {
  return tl::make_unexpected(Error::usage(fmt::format("{}: got '{}', takes {}", variable, got, takes)));
}

std::optional<std::string> environment(const char* variable) {
  const char* value = std::getenv(variable);
  if (value == nullptr || *value == '\0') return {};
  return value;
}

/// All of `text` as finite numbers between commas; empty when it isn't that.
std::vector<double> numbers(const std::string& text) {
  std::vector<double> values;
  std::istringstream in(text);
  for (std::string field; std::getline(in, field, ',');) {
    char* end = nullptr;
    values.push_back(std::strtod(field.c_str(), &end));
    if (field.empty() || *end != '\0' || !std::isfinite(values.back())) return {};
  }
  return values;
}

std::int64_t count_lines(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return std::count(std::istreambuf_iterator<char>(in), {}, '\n');
}

Expected<AtEnd> at_end_by_name(const std::string& name) {
  if (name == "repeat") return AtEnd::repeat;
  if (name == "stall") return AtEnd::stall;
  if (name == "unplug") return AtEnd::unplug;
  return refuse("TUBETRACK_VIRTUAL_AT_END", name, "repeat, stall or unplug");
}

}  // namespace

Expected<PlayerSettings> player_settings_from_environment() {
  PlayerSettings settings;
  settings.recording = environment("TUBETRACK_VIRTUAL_DEVICE").value_or("");
  settings.lockstep = environment("TUBETRACK_VIRTUAL_LOCKSTEP").value_or("");
  if (const auto text = environment("TUBETRACK_VIRTUAL_INTRINSICS")) {
    const auto values = numbers(*text);
    if (values.size() != 4) return refuse("TUBETRACK_VIRTUAL_INTRINSICS", *text, "fx,fy,cx,cy in pixels");
    settings.options.intrinsics_px = {values[0], values[1], values[2], values[3]};
  }
  if (const auto text = environment("TUBETRACK_VIRTUAL_DEPTH_SCALE")) {
    const auto values = numbers(*text);
    if (values.size() != 1) return refuse("TUBETRACK_VIRTUAL_DEPTH_SCALE", *text, "metres per unit");
    settings.options.metres_per_unit = values[0];
  }
  if (const auto text = environment("TUBETRACK_VIRTUAL_SPEED")) {
    const auto values = numbers(*text);
    if (values.size() != 1 || values[0] <= 0.0) return refuse("TUBETRACK_VIRTUAL_SPEED", *text, "a factor above 0");
    settings.speed = values[0];
  }
  if (const auto text = environment("TUBETRACK_VIRTUAL_AT_END")) {
    const auto at_end = at_end_by_name(*text);
    if (!at_end) return tl::make_unexpected(at_end.error());
    settings.at_end = *at_end;
  }
  settings.fault_script = environment("TUBETRACK_VIRTUAL_FAULTS").value_or("");
  if (settings.fault_script.empty() && !settings.recording.empty()) {
    std::filesystem::path beside = settings.recording;
    if (!beside.has_filename()) beside = beside.parent_path();
    beside += ".faults";
    std::error_code ignored;
    if (std::filesystem::exists(beside, ignored)) settings.fault_script = beside;
  }
  if (const auto text = environment("TUBETRACK_VIRTUAL_MIRROR")) {
    if (*text != "on" && *text != "always") return refuse("TUBETRACK_VIRTUAL_MIRROR", *text, "on or always");
    settings.always_mirrored = *text == "always";
  }
  return settings;
}

void write_pixels(const DepthFrame& frame, const OutputFormat& format, std::uint16_t* out) {
  const double factor = frame.metres_per_unit / format.metres_per_unit;
  const bool same_unit = std::abs(factor - 1.0) < 1e-9;
  for (int v = 0; v < format.height; ++v) {
    const std::uint16_t* row = frame.row((format.origin_v + v) * format.step);
    for (int i = 0; i < format.width; ++i) {
      const int u = format.origin_u + i;
      const std::uint16_t value = row[(format.mirrored ? frame.width / format.step - 1 - u : u) * format.step];
      if (same_unit) {
        *out++ = value;
      } else {
        const double scaled = std::round(value * factor);
        *out++ = scaled <= 65535.0 ? static_cast<std::uint16_t>(scaled) : std::uint16_t{0};
      }
    }
  }
}

RecordingPlayer::RecordingPlayer(PlayerSettings settings, PlayerCallbacks callbacks)
    : settings_(std::move(settings)),
      callbacks_(std::move(callbacks)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

RecordingPlayer::~RecordingPlayer() = default;

void RecordingPlayer::run(const std::stop_token& stop) {
  if (!settings_.lockstep.empty()) lines_at_start_ = count_lines(settings_.lockstep);
  wait_until_ready(stop);
  started_ = silent_until_ = Clock::now();
  while (!stop.stop_requested()) {
    // Opened again each round: a source can't be wound back. It opened before, so if it fails now it is gone: stall.
    auto recording = open_recording(settings_.recording, settings_.options);
    if (!recording || play_once(*recording->source, stop) == 0 || unplugged_) return;
    if (settings_.at_end == AtEnd::unplug && !stop.stop_requested()) callbacks_.on_unplug(-1.0);
    if (settings_.at_end != AtEnd::repeat) return;
  }
}

std::int64_t RecordingPlayer::play_once(FrameSource& source, const std::stop_token& stop) {
  const std::int64_t played_before = played_;
  const std::int64_t first_index = next_index_;
  std::optional<double> first_timestamp_s;
  double last_timestamp_s = 0.0;
  DepthFrame frame;
  while (!stop.stop_requested()) {
    const FrameOutcome outcome = source.next(frame, std::chrono::milliseconds{1000});
    if (outcome == FrameOutcome::end_of_stream || outcome == FrameOutcome::device_lost) break;
    if (outcome != FrameOutcome::ok) continue;
    if (!first_timestamp_s) {
      first_timestamp_s = frame.timestamp_s;
      if (played_ == 0) first_timestamp_s_ = next_timestamp_s_ = frame.timestamp_s;
      offset_s_ = next_timestamp_s_ - frame.timestamp_s;
    }
    last_timestamp_s = frame.timestamp_s;
    frame.timestamp_s += offset_s_;
    frame.index += first_index;
    const FaultTurn turn = callbacks_.next_turn();
    const bool send = wait_for_turn(frame.timestamp_s, turn, stop);
    if (stop.stop_requested() || unplugged_) break;
    ++played_;
    next_index_ = frame.index + 1;
    if (!send) continue;
    frame.timestamp_s += turn.time_shift_s + zero_shift_s_;
    if (frame.timestamp_s < 0.0) zero_shift_s_ -= std::exchange(frame.timestamp_s, 0.0);
    if (turn.still && last_sent_s_) frame.timestamp_s = *last_sent_s_;
    last_sent_s_ = frame.timestamp_s;
    callbacks_.on_frame(frame, turn.cut);
    ++sent_;
  }
  const std::int64_t played = played_ - played_before;
  if (played > 0 && first_timestamp_s) {
    // A repeat follows at the recording's mean pace.
    const double round_s = last_timestamp_s - *first_timestamp_s;
    const double interval_s = played > 1 ? round_s / static_cast<double>(played - 1) : 1.0 / 30.0;
    next_timestamp_s_ = last_timestamp_s + offset_s_ + interval_s;
  }
  return played;
}

void RecordingPlayer::wait_until_ready(const std::stop_token& stop) {
  const auto give_up = Clock::now() + kStartPatience;
  while (!stop.stop_requested() && !callbacks_.ready() && (!settings_.lockstep.empty() || Clock::now() < give_up)) {
    wait_until(Clock::now() + kPoll, stop);
  }
}

bool RecordingPlayer::wait_for_turn(double timestamp_s, const FaultTurn& turn, const std::stop_token& stop) {
  if (turn.unplug_for_s) {
    unplugged_ = true;
    callbacks_.on_unplug(*turn.unplug_for_s);
    return false;
  }
  if (turn.stall_s > 0.0) {
    silent_until_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(turn.stall_s / settings_.speed));
    wait_until(silent_until_, stop);
  }
  if (!settings_.lockstep.empty()) {
    const auto taken = [this] { return count_lines(settings_.lockstep) - lines_at_start_; };
    while (!turn.at_once && !stop.stop_requested() && taken() < sent_) wait_until(Clock::now() + kPoll, stop);
    return !turn.drop;
  }
  const std::chrono::duration<double> since_first((timestamp_s - first_timestamp_s_) / settings_.speed);
  const auto due = started_ + std::chrono::duration_cast<Clock::duration>(since_first);
  if (!turn.at_once) wait_until(due, stop);
  return !turn.drop && due >= silent_until_;
}

void RecordingPlayer::wait_until(Clock::time_point due, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  wake_.wait_until(lock, stop, due, [] { return false; });
}

}  // namespace tubetrack
