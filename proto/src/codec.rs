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

use crate::parts::{MAX_PARTS, has_too_many_parts, is_request};

/// Encodes the same bytes as `tonic_prost::ProstCodec`, but from and into plain slices: prost accesses its buffer once
/// per number, and with gRPC's buffers each access costs more than the number itself. Requests of more than [`MAX_PARTS`] parts are
/// refused before they are decoded; answers come from a server that the client has chosen.
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
        if is_request::<U>() && has_too_many_parts::<U>(&bytes) {
            let problem = format!("it has more than {MAX_PARTS} messages, texts and lists");
            return Err(Status::internal(problem));
        }
        // gRPC assigns INTERNAL to messages that cannot be decoded.
        let message = U::decode(&*bytes).map_err(|error| Status::internal(error.to_string()))?;
        Ok(Some(message))
    }
}
