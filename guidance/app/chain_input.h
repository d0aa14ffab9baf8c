#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/app/chain_check.h"
#include "idl/cpp/guidance_messages.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// What guidance published about the points of one machine.
struct GuidedRecord {
  std::string machine_id;
  std::size_t messages = 0;
  GuidedTracks tracks;
  std::vector<std::string> remarks;  // what was passed over, for the user
};

// Adds a message's points. The covariance of a point is put together from the sigmas along, to the
// right and up, in the directions of the design there as the points of the machine show them: its
// correlations along the drive are not published and taken as none.
void AddGuidance(const dds::Guidance& message, GuidedRecord* record);

// Whether this is a record of guidance: a journal, a folder of them, or the CSV that `tbm export`
// makes of the topic guidance.
bool IsGuidanceRecord(const std::string& path);

// Reads one. The error is a sentence that names file and, in a CSV, line and column.
Result<GuidedRecord, std::string> ReadGuidanceRecord(const std::string& path);
Result<GuidedRecord, std::string> ParseGuidanceCsv(std::string text, const std::string& file);

// Shots of every point, a CSV with stamp_ns,point,x_mm,y_mm,z_mm or a Leica GSI file, whose blocks
// have no times: `at` is then the time of all of them. The same for rows without a stamp.
Result<std::vector<MachineShot>, std::string> ReadShots(const std::string& path,
                                                        std::optional<Timestamp> at);

}  // namespace tbm
