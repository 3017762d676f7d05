#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "track_options.hpp"
#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// Flags about a live device, as typed: empty where not given.
struct DeviceFlags {
  RecordingFlags reading;  ///< --frames, --intrinsics, --depth-scale
  std::string mode, crop, silence;
  std::string on_reconnect = "reset";
  std::filesystem::path record_oni;  ///< set by the command
  bool reconnects() const { return on_reconnect != "stop"; }
};

/// --frames, --intrinsics, --depth-scale, --mode, --crop, --silence.
void add_device_flags(CLI::App& command, DeviceFlags& flags);

/// Opens a live device (empty: the first one). Frames before `--frames A:B` are passed over, after it the stream ends.
/// A lost device is opened again unless --on-reconnect is `stop`. In a build without the back-end the error names the
/// package.
Expected<std::unique_ptr<FrameSource>> open_device(const std::string& uri, const DeviceFlags& flags);

/// One line about an open device for people: its mode and where its intrinsics come from.
std::string device_note(const StreamInfo& info, const DeviceFlags& flags);

/// What a build without OpenNI2 says.
Error without_openni2();

}  // namespace tubetrack
