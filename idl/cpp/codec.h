#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "idl/cpp/boundary.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"

namespace tbm::dds {

// A message as bytes, exactly those that DDS sends: CDR with its four bytes of encapsulation, which
// is what journals call "cdr". Replaces what is in `bytes`. What breaks the contract is not
// encoded, and `bytes` is empty.
template <class Message>
BoundaryFault EncodeCdr(const Message& message, std::vector<std::byte>* bytes);

// Back again. Nothing but kNone leaves anything in `message` that may be used.
template <class Message>
BoundaryFault DecodeCdr(std::span<const std::byte> bytes, Message* message);

// The text of the .idl file that declares a topic's type ("tbm::v1::Guidance"), encoding "omgidl".
// Empty for a type that is not of the contract.
std::string_view IdlTextOf(std::string_view type);

}  // namespace tbm::dds
