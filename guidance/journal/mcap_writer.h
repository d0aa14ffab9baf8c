#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "guidance/journal/mcap_format.h"
#include "pose/base/time.h"

namespace tbm {

// Makes the bytes of one MCAP file (version 0; mcap.dev/spec). Pure: whoever calls it writes the
// bytes where they belong and decides when they are on the disk.
//
// Messages are gathered into chunks, uncompressed, each with its CRC-32. All that was handed out up
// to the end of a chunk can be read without what follows: a file that ends anywhere loses the chunk
// that was being written, and nothing else. Schemas and channels stand before the first chunk that
// needs them, outside of chunks. What is kept in memory grows by about 100 bytes a chunk.
class McapWriter {
 public:
  // `library` names the program that writes, with its version.
  explicit McapWriter(std::string_view library);

  // Magic and header: the first bytes of the file. Once, before anything else.
  Bytes Begin();

  // A channel for `topic`; one for each call. Its records go out with the next chunk. An empty
  // schema is none.
  std::uint16_t AddChannel(std::string_view topic,
                           std::string_view message_encoding,
                           const McapSchema& schema);

  // Into the chunk that is being gathered. `log_time` is when it was received or made here,
  // `publish_time` when its sender sent it.
  void AddMessage(std::uint16_t channel,
                  std::uint32_t sequence,
                  Timestamp log_time,
                  Timestamp publish_time,
                  BytesView data);

  // Size of the chunk that is being gathered.
  std::size_t gathered_bytes() const { return chunk_.size(); }

  // The chunk gathered so far with its index, and nothing when there is none. The next begins.
  Bytes TakeChunk();

  // Takes the last chunk, then the end of the data, the summary and the footer: the last bytes of
  // the file.
  Bytes End();

 private:
  struct Index {
    std::uint64_t start = 0;  // of the chunk record in the file
    std::uint64_t length = 0;
    std::uint64_t first_time = 0;
    std::uint64_t last_time = 0;
    std::uint64_t records_size = 0;
    std::map<std::uint16_t, std::uint64_t> offset_of_channel;  // of its message index in the file
    std::uint64_t index_length = 0;
  };

  Bytes Handed(Bytes bytes);

  std::string library_;
  std::uint64_t written_ = 0;  // bytes handed out
  Bytes schemas_;              // all records so far, for the summary
  Bytes channels_;
  Bytes pending_;  // records that have not been handed out
  std::uint16_t channel_count_ = 0;
  std::uint16_t schema_count_ = 0;
  Bytes chunk_;
  std::uint64_t chunk_first_time_ = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t chunk_last_time_ = 0;
  // Of the messages in the chunk: time and offset, by channel.
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunk_index_;
  std::vector<Index> indexes_;
  std::map<std::uint16_t, std::uint64_t> message_count_;
};

}  // namespace tbm
