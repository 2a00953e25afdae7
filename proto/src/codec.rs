//! Encoding of messages.

use std::marker::PhantomData;

use prost::{
    Message, Name,
    bytes::{Buf as _, BufMut as _},
};
use tonic::{
    Status,
    codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder},
};

use crate::parts::{MAX_DECODED_BESIDES, is_request, is_too_large_decoded};

/// Encodes the same bytes as `tonic_prost::ProstCodec`, but from and into plain slices: prost accesses its buffer once
/// per number, and with gRPC's buffers each access costs more than the number itself. Requests that would take too much
/// memory are refused before they are decoded; answers come from a server that the client has chosen.
#[derive(Debug)]
pub struct SliceCodec<T, U>(PhantomData<(T, U)>);

impl<T, U> Default for SliceCodec<T, U> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T, U> Codec for SliceCodec<T, U>
where
    T: Message + 'static,
    U: Message + Name + Default + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self::default()
    }

    fn decoder(&mut self) -> Self {
        Self::default()
    }
}

impl<T: Message, U> Encoder for SliceCodec<T, U> {
    type Item = T;
    type Error = Status;

    fn encode(&mut self, message: T, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        let mut bytes = vec![0; message.encoded_len()];
        let written = message.encode(&mut bytes.as_mut_slice());
        written.map_err(|error| Status::internal(error.to_string()))?;
        buffer.put_slice(&bytes);
        Ok(())
    }
}

impl<T, U: Message + Name + Default> Decoder for SliceCodec<T, U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        let bytes = buffer.copy_to_bytes(buffer.remaining());
        decoded(&bytes).map(Some)
    }
}

/// A received message.
///
/// # Errors
/// The bytes are not this message, or it is a request that would take too much memory.
pub fn decoded<M: Message + Name + Default>(bytes: &[u8]) -> Result<M, Status> {
    if is_request::<M>() && is_too_large_decoded::<M>(bytes) {
        let problem = format!(
            "it takes more memory than {} KiB and twice its bytes, meshes aside; send fewer messages, texts or numbers",
            MAX_DECODED_BESIDES >> 10
        );
        return Err(Status::internal(problem));
    }
    // gRPC assigns INTERNAL to messages that cannot be decoded.
    M::decode(bytes).map_err(|error| Status::internal(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    const MANY: usize = 16_384;

    #[test]
    fn what_clients_send_is_bounded_in_memory_and_what_servers_answer_is_not() {
        let holdout = v1::Holdout {
            obstacles: vec![v1::Shape::default(); MANY],
            ..v1::Holdout::new("objects/mug")
        };
        let frame = v1::TrackFrame::of(1, holdout.clone());
        assert!(decoded::<v1::TrackFrame>(&frame.encode_to_vec()).is_err());
        let track = v1::Track {
            holdout: Some(holdout),
            ..Default::default()
        };
        assert!(decoded::<v1::Track>(&track.encode_to_vec()).is_err());
        let answer = v1::FindGraspResponse {
            grasps: vec![v1::Grasp::default(); MANY],
            ..Default::default()
        };
        assert_eq!(
            decoded::<v1::FindGraspResponse>(&answer.encode_to_vec()).unwrap(),
            answer
        );
    }
}
