#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "hmi_bridge/core/heard.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/rail_messages.h"
#include "pose/rig/rig.h"

// The one place where messages become what a console shows: millimetres, degrees, words, rounded,
// null for what is not known. Shapes and units: openapi.yaml.
namespace tbm::hmi {

using Json = nlohmann::ordered_json;

// Rounded to what a person can use; null for NaN.
Json Rounded(double value, int digits);

// When a value is stale [ms]: two periods of its source.
Json TimingOf(const Arrival& arrival, Timestamp stamp, std::int64_t stale_after_ms);

Json ViewOf(const dds::Guidance& guidance, Json timing);
Json ViewOf(const dds::ShieldPose& pose, Json timing);
Json ViewOf(const dds::TiltReading& tilt, Json timing);
Json ViewOf(const dds::StationSetUp& set_up, Json timing);
Json ViewOf(const dds::StationObservation& observation);
Json ViewOf(const dds::DeviceHealth& health, Json timing);
Json ViewOf(const dds::Event& event);
Json ViewOf(const dds::TrolleyState& state, Json timing);
// Of the whole comparison that the piece is of.
Json ViewOf(const dds::SettlementPiece& piece);
Json ViewOf(const dds::RelativePose& pose, const Rig& rig, Json timing);
// Residuals are measured minus projected from `pose` [px], where that is of the same frame; null
// without it.
Json ViewOf(const dds::FrameFeatures& frame,
            const dds::RelativePose* pose,
            const Rig& rig,
            Json timing);

}  // namespace tbm::hmi
