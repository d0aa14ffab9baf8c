#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "hmi_bridge/server/http_message.h"
#include "hmi_bridge/server/server_options.h"

namespace tbm::hmi {

using BeastRequest = boost::beast::http::request<boost::beast::http::string_body>;
using BeastParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

inline void Limit(BeastParser& parser, const ServerLimits& limits) {
  parser.header_limit(static_cast<std::uint32_t>(limits.header_bytes));
  // The largest there is; what this very request may bring is decided by its head.
  parser.body_limit(std::max(limits.body_bytes, limits.report_bytes));
}

// What the router decides by, out of what Boost.Beast has read.
inline Request RequestFrom(const BeastRequest& read, const Peer& peer) {
  namespace http = boost::beast::http;
  const auto text = [](boost::beast::string_view view) {
    return std::string(view.data(), view.size());
  };
  const auto value = [&](http::field name) { return text(read[name]); };
  Request request;
  request.method = text(read.method_string());
  request.target = text(read.target());
  request.is_keep_alive = read.keep_alive();
  request.is_upgrade = boost::beast::websocket::is_upgrade(read);
  request.has_one_host = read.count(http::field::host) == 1;
  request.has_transfer_encoding = read.count(http::field::transfer_encoding) > 0;
  request.host = value(http::field::host);
  request.has_origin = read.count(http::field::origin) > 0;
  // Two of them are nobody's.
  if (read.count(http::field::origin) == 1) request.origin = value(http::field::origin);
  request.cookie = value(http::field::cookie);
  request.authorization = value(http::field::authorization);
  request.content_type = value(http::field::content_type);
  request.accept_encoding = value(http::field::accept_encoding);
  request.if_none_match = value(http::field::if_none_match);
  request.fetch_site = text(read["Sec-Fetch-Site"]);
  request.subprotocols = value(http::field::sec_websocket_protocol);
  request.body = read.body();
  request.peer = peer;
  return request;
}

// For what did not become a request: how to say so.
inline int StatusOf(const boost::system::error_code& error) {
  namespace http = boost::beast::http;
  if (error == http::error::body_limit) return 413;
  if (error == http::error::header_limit || error == http::error::buffer_overflow) return 431;
  return 400;
}

}  // namespace tbm::hmi
