//! Whole solves: what they find, what they leave out, what stays the same.

mod api;
mod closed_form;
mod depth_error;
mod devices;
mod external;
mod instrument;
mod layers;
mod learned;
mod leave_out;
mod live;
mod outline;
mod paper;
mod paper_room;
mod physics;
mod places;
mod plates;
mod published;
mod scale;
mod session;
mod surface;
mod taken_off;
mod traffic;
mod unmirrored;
mod wider;
