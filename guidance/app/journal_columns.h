#pragma once

#include "guidance/app/journal_table.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/rail_messages.h"

namespace tbm {

// A message as cells of one row, each under the name that its field has in the .idl file, so that a
// name and its value stand in one line of code. What a message holds several of is told with its
// own name, or its place from 1, before that of the field.
void AddCells(JournalRow& row, const dds::FrameFeatures& message);
void AddCells(JournalRow& row, const dds::TiltReading& message);
void AddCells(JournalRow& row, const dds::RelativePose& message);
void AddCells(JournalRow& row, const dds::DeviceHealth& message);
void AddCells(JournalRow& row, const dds::Event& message);
void AddCells(JournalRow& row, const dds::StationObservation& message);
void AddCells(JournalRow& row, const dds::StationSetUp& message);
void AddCells(JournalRow& row, const dds::ShieldPose& message);
void AddCells(JournalRow& row, const dds::Guidance& message);
void AddCells(JournalRow& row, const dds::AlarmStatus& message);
void AddCells(JournalRow& row, const dds::Command& message);
void AddCells(JournalRow& row, const dds::CommandReply& message);
void AddCells(JournalRow& row, const dds::TrolleyState& message);
void AddCells(JournalRow& row, const dds::RailLinePiece& message);
void AddCells(JournalRow& row, const dds::SettlementPiece& message);
void AddCells(JournalRow& row, const dds::CalibrationStatus& message);

}  // namespace tbm
